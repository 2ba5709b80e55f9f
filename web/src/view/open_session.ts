/** Shows a session of the server in a viewer, with all that can be done with it. */

import type { Api } from '../server/api';
import type { Options, Session } from '../wire';
import { partsOf } from './parts';
import { SessionPlace } from './session_place';
import { TrainingPanel } from './training_panel';
import { Viewer, type ViewerOptions } from './viewer';

export interface ShownSession {
  readonly viewer: Viewer;
  /** To be told of all events of the session. */
  readonly place: SessionPlace;
}

export interface SessionViewOptions extends Omit<ViewerOptions, 'parts'> {
  /** 3D Gaussians can be trained from here. */
  readonly trains: boolean;
}

/** Show a session in an element, until the viewer is disposed of. */
export function showSession(
  api: Api, session: Session, options: Options, element: HTMLElement, { trains, ...rest }: SessionViewOptions,
): ShownSession {
  const place = new SessionPlace(api, session, options);
  const panel = trains ? new TrainingPanel(api, place) : null;
  const more = [...panel === null ? [] : [panel.element], ...rest.more ?? []];
  const viewer = new Viewer(element, place, { ...rest, parts: partsOf(), more });
  panel?.onSplat(() => void viewer.show('splat'));
  panel?.onView((capture) => viewer.goTo(place.place.views.findIndex(({ name }) => name === capture)));
  return { viewer, place };
}
