/** Words that several pages use. */

/** "1 view", "2 views". */
export function viewsText(count: number): string {
  return count === 1 ? '1 view' : `${count} views`;
}
