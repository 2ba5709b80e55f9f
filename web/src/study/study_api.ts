/** The study's addresses for a participant's phone, typed by `server/study/wire.py`. */

import { dictionary, parseKept, text } from '../schema';
import { ApiError, type Api } from '../server/api';
import { followEvents, type EventsListener } from '../server/events';
import {
  answersRefusedSchema, participantStateSchema, type Answered, type Consent, type Draft,
  type ParticipantState, type SessionBegun, type Told, type ToldEvents,
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
    return this.api.ask('GET', '/study/texts', dictionary(text));
  }

  state(): Promise<ParticipantState> {
    return this.#ask('GET', '');
  }

  follow(listener: EventsListener<ParticipantState>, signal: AbortSignal): Promise<void> {
    return followEvents((open) => this.api.eventBytes(`${this.#path}/events`, open),
      participantStateSchema, listener, signal);
  }

  consent(consent: Consent): Promise<ParticipantState> {
    return this.#ask('PUT', '/consent', consent);
  }

  draft(step: string, answers: Answers): Promise<ParticipantState> {
    const json: Draft = { answers };
    return this.#ask('PATCH', `${stepPath(step)}/draft`, json);
  }

  /** @throws ApiError 422 when something is missing: `refusedItems` says what. */
  handIn(step: string, answers: Answers): Promise<ParticipantState> {
    const json: Answered = { answers };
    return this.#ask('PUT', `${stepPath(step)}/answers`, json);
  }

  finish(step: string): Promise<ParticipantState> {
    return this.#ask('PUT', `${stepPath(step)}/finished`);
  }

  beginSession(step: string, session: string): Promise<ParticipantState> {
    const json: SessionBegun = { session };
    return this.#ask('PUT', `${stepPath(step)}/session`, json);
  }

  /** May be repeated: each event is kept once. */
  tell(batchId: string, session: string, events: readonly Told[]): Promise<void> {
    const json: ToldEvents = { session, events };
    return this.api.tell('PUT', `${this.#path}/told/${encodeURIComponent(batchId)}`, json);
  }

  #ask(method: string, path: string, json?: object): Promise<ParticipantState> {
    return this.api.ask(method, this.#path + path, participantStateSchema, json);
  }
}

function stepPath(step: string): string {
  return `/steps/${encodeURIComponent(step)}`;
}

/** What is wrong with which item of a form that the server refused; null for another error. */
export function refusedItems(error: unknown): Readonly<Record<string, string>> | null {
  if (!(error instanceof ApiError) || error.status !== 422) return null;
  return parseKept(answersRefusedSchema, error.body)?.items ?? null;
}

/** Fill the places of a text: `fill('Step {n}', { n: 2 })`. */
export function fill(template: string, values: Readonly<Record<string, string | number>>): string {
  return template.replace(/\{(\w+)\}/g, (all, name: string) => String(values[name] ?? all));
}
