/** The small picture in the list of views. */

const LONG_SIDE_PX = 260;

/** Same aspect, long side 260 px, never larger than the photo. */
export function thumbnailSize(
  width_px: number, height_px: number,
): { readonly width_px: number; readonly height_px: number } {
  const scale = Math.min(1, LONG_SIDE_PX / Math.max(width_px, height_px));
  return {
    width_px: Math.max(1, Math.round(width_px * scale)),
    height_px: Math.max(1, Math.round(height_px * scale)),
  };
}
