/** /view#SESSION: a session of this server as a place; without one, the place beside or inside the page. */

import { Api, ApiError } from '../server/api';
import { sessionEvents } from '../server/events';
import { make } from '../ui/dom';
import { showSession } from './open_session';
import { partsOf } from './parts';
import { openShared, sayInstead } from './shared';

const SESSION = /^#([0-9a-f]{8}-[0-9a-f-]{27})$/i;

async function main(element: HTMLElement): Promise<void> {
  const api = new Api();
  await api.pairFromHash();
  const id = SESSION.exec(location.hash)?.[1];
  if (id === undefined) return openShared(partsOf(), element);
  const [{ options }, session] = await Promise.all([api.server(), api.session(id)]);
  document.title = `peaking: ${session.summary.name}`;
  const back = make('a', { href: `./sessions#${id}`, title: 'Back to the session' }, 'Session');
  const { viewer, place } = showSession(api, session, options, element, { keysOf: window, trains: true, more: [back] });
  Object.assign(window, { viewer });
  await sessionEvents(api, id, {
    onEvent: (event) => place.follow(event), onConnection: (...told) => viewer.connected(...told),
  }, new AbortController().signal, { role: 'watch' });
}

window.addEventListener('hashchange', () => location.reload());
const element = document.getElementById('view') ?? document.body;
main(element).catch((error: unknown) => {
  sayInstead(element, error instanceof ApiError ? error.problem : String(error));
});
