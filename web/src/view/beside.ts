/** What is captured so far, as a place, in the half of a large screen that the picture leaves empty. */

import type { CaptureSession } from '../capture/capture_session';
import type { Api } from '../server/api';
import { sessionEvents } from '../server/events';
import { make, show } from '../ui/dom';
import type { Options } from '../wire';
import type { ShownSession } from './open_session';

/** There is room for it; the same as in capture.css. */
const ROOM = '(min-width: 1400px) and (min-height: 600px)';

/** Show the session's views beside the picture as soon as the server has one and there is room. */
export function showBeside(api: Api, session: CaptureSession, options: Options, element: HTMLElement): void {
  const room = matchMedia(ROOM);
  let begun = false;
  const begin = (): void => {
    const isThere = session.views.some(({ onServer }) => onServer);
    show(element, room.matches);
    if (begun || !room.matches || !isThere) return;
    begun = true;
    void follow(api, session.id, options, element);
  };
  element.append(make('p', { className: 'quiet' }, 'Your views appear here, as a place to turn around.'));
  session.subscribe(begin);
  room.addEventListener('change', begin);
  begin();
}

async function follow(api: Api, id: string, options: Options, element: HTMLElement): Promise<void> {
  const { showSession } = await import('./open_session');
  let seen: ShownSession | null = null;
  await sessionEvents(api, id, {
    onEvent: (event) => {
      if (event.type === 'SessionState' && seen === null) {
        seen = showSession(api, event.session, options, element, { compact: true, trains: false, first: 'place' });
      } else {
        seen?.place.follow(event);
      }
    },
    onConnection: (...told) => seen?.viewer.connected(...told),
  }, new AbortController().signal, { role: 'watch' });
}
