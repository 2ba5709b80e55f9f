/** Server-sent events as text: https://html.spec.whatwg.org/multipage/server-sent-events.html. */

/** Takes a stream in pieces of any length and gives the `data` of each event that is complete. */
export class EventStreamReader {
  #rest = '';
  #data: string[] = [];

  /** @returns Data of the events that this piece completed, in order; comments are left out. */
  push(text: string): readonly string[] {
    const lines = (this.#rest + text).split(/\r\n|\n|\r(?!$)/);
    this.#rest = lines.pop() ?? '';
    const events: string[] = [];
    for (const line of lines) {
      if (line === '') {
        if (this.#data.length > 0) events.push(this.#data.join('\n'));
        this.#data = [];
      } else if (line === 'data' || line.startsWith('data:')) {
        this.#data.push(line.slice(5).replace(/^ /, ''));
      }
    }
    return events;
  }
}
