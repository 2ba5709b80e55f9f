/** The study's addresses for a participant's phone, typed by `server/study/wire.py`. */

import { ApiError, type Api } from '../server/api';
import { followEvents, type EventsListener } from '../server/events';
import type {
  Answered, AnswersRefused, Consent, Draft, ParticipantState, SessionBegun, StepDone, Told,
  ToldEvents,
} from './wire';

export type Texts = Readonly<Record<string, string>>;
export type Answer = number | string | readonly string[] | null;
export type Answers = Readonly<Record<string, Answer>>;

/** What a participant's phone says and hears. */
export class ParticipantApi {
  readonly #path: string;

  constructor(readonly api: Api, readonly participant: string) {
    this.#path = `/study/participants/${encodeURIComponent(participant)}`;
  }

  texts(): Promise<Texts> {
    return this.#ask('GET', '/study/texts');
  }

  state(): Promise<ParticipantState> {
    return this.#ask('GET', this.#path);
  }

  follow(listener: EventsListener<ParticipantState>, signal: AbortSignal): Promise<void> {
    return followEvents((open) => this.api.eventBytes(`${this.#path}/events`, open), listener,
      signal);
  }

  consent(consent: Consent): Promise<ParticipantState> {
    return this.#ask('POST', `${this.#path}/consent`, consent);
  }

  draft(draft: Draft): Promise<ParticipantState> {
    return this.#ask('PUT', `${this.#path}/draft`, draft);
  }

  /** @throws ApiError 422 when something is missing: `refusedItems` says what. */
  handIn(answers: Answered): Promise<ParticipantState> {
    return this.#ask('POST', `${this.#path}/answers`, answers);
  }

  finish(step: StepDone): Promise<ParticipantState> {
    return this.#ask('POST', `${this.#path}/finish`, step);
  }

  beginSession(begun: SessionBegun): Promise<ParticipantState> {
    return this.#ask('POST', `${this.#path}/session`, begun);
  }

  async tell(session: string, events: readonly Told[]): Promise<void> {
    const json: ToldEvents = { session, events };
    await this.api.ask('POST', `${this.#path}/told`, json);
  }

  async #ask<T>(method: string, path: string, json?: object): Promise<T> {
    const answer = await this.api.ask<T>(method, path, json);
    if (answer === null) throw new ApiError(0, 'The server said nothing where it should have.');
    return answer;
  }
}

/** What is wrong with which item of a form that the server refused; null for another error. */
export function refusedItems(error: unknown): Readonly<Record<string, string>> | null {
  if (!(error instanceof ApiError) || error.status !== 422) return null;
  return (JSON.parse(error.body) as AnswersRefused).items;
}

/** Fill the places of a text: `fill('Step {n}', { n: 2 })`. */
export function fill(text: string, values: Readonly<Record<string, string | number>>): string {
  return text.replace(/\{(\w+)\}/g, (all, name: string) => String(values[name] ?? all));
}
