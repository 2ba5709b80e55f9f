// Generated from src/peaking/server/study/wire.py by `make wire`; do not edit.

import {
  dictionary, flag, integer, list, nullable, number, oneOf, optional, record, tagged, text,
  union, type Schema,
} from '../schema';

/** Characters of an answer in words. */
export const MAX_TEXT = 10000;
/** Events that a phone tells at once. */
export const MAX_EVENTS = 200;

/** One of the answers to choose from. */
export interface Choice {
  readonly value: string;
  readonly text: string;
}

/** One question. */
export interface Item {
  readonly id: string;
  readonly text: string;
  readonly kind: 'choice' | 'choices' | 'number' | 'rating' | 'scale' | 'text';
  readonly points?: number;
  readonly low?: string;
  readonly high?: string;
  readonly choices?: readonly Choice[];
  readonly smallest?: number;
  readonly largest?: number;
  readonly optional?: boolean;
  readonly help?: string;
  readonly reversed?: boolean;
}

/** A form that is filled in at once. */
export interface Questionnaire {
  readonly name: string;
  readonly title: string;
  readonly items: readonly Item[];
  readonly instruction?: string;
  readonly scoring?: 'harus' | 'items' | 'mean' | 'nasa_rtlx' | 'nasa_tlx' | 'sus';
  readonly prefix?: string | null;
  readonly source?: string;
}

/** How the capture page looks in a trial. The name of the condition stays with the server. */
export interface CaptureSetting {
  readonly overlay: 'none' | 'peaks';
  readonly guide: 'none' | 'plenoptic';
  readonly area_side_m: number | null;
  readonly session: string | null;
}

/** The step that a participant is at. */
export interface ShownStep {
  readonly key: string;
  readonly kind: 'ask' | 'capture' | 'consent' | 'introduction' | 'practice' | 'review' | 'scan';
  readonly running: boolean;
  readonly text: string;
  readonly form?: Questionnaire | null;
  readonly draft?: Readonly<Record<string, number | string | readonly string[] | null>>;
  readonly capture?: CaptureSetting | null;
  readonly over_camera?: boolean;
}

/** GET /api/v1/study/participants/{participant}, and every event of its stream. */
export interface ParticipantState {
  readonly type: 'ParticipantState';
  readonly participant: string;
  readonly title: string;
  readonly language: string;
  readonly step: ShownStep | null;
  readonly done: number;
  readonly total: number;
  readonly refused?: boolean;
}

/** PUT …/consent. */
export interface Consent {
  readonly agreed: boolean;
  readonly images?: boolean;
}

/** PATCH …/steps/{step}/draft: the answers that were changed, and only those. */
export interface Draft {
  readonly answers: Readonly<Record<string, number | string | readonly string[] | null>>;
}

/** PUT …/steps/{step}/answers. */
export interface Answered {
  readonly answers: Readonly<Record<string, number | string | readonly string[] | null>>;
}

/** The problem of status 422: what is wrong with which item (keys of the texts). */
export interface AnswersRefused {
  readonly type: string;
  readonly title: string;
  readonly status: number;
  readonly detail: string;
  readonly items: Readonly<Record<string, string>>;
}

/** PUT …/steps/{step}/session: the capture session of a step. */
export interface SessionBegun {
  readonly session: string;
}

/** Something that happened on the phone; the events of `study/records.py` with these names. */
export interface Told {
  readonly kind: 'CaptureBegun' | 'CaptureEnded' | 'GuideTold' | 'PageGone' | 'PeakedTold' | 'TrackingFound' | 'TrackingLost' | 'ViewJoined' | 'ViewTaken' | 'ViewUndone';
  readonly id: string;
  readonly step: string;
  readonly time_s: number;
  readonly capture?: string | null;
  readonly world_from_cam?: readonly number[] | null;
  readonly acknowledged_s?: number | null;
  readonly generated_s?: number | null;
  readonly peaked_share?: number | null;
  readonly wrong_share?: number | null;
  readonly unseen_share?: number | null;
  readonly unfixable_share?: number | null;
  readonly views?: number | null;
  readonly until_s?: number | null;
  readonly name?: string | null;
  readonly value?: number | null;
}

/** PUT …/told/{batch}; each event is kept once, in whatever batch it comes. */
export interface ToldEvents {
  readonly session: string;
  readonly events: readonly Told[];
}

/** One step as the console shows it. */
export interface StepLine {
  readonly key: string;
  readonly kind: 'ask' | 'capture' | 'consent' | 'introduction' | 'practice' | 'review' | 'scan';
  readonly label: string;
  readonly state: 'done' | 'running' | 'waiting';
  readonly began_s?: number | null;
  readonly ended_s?: number | null;
}

/** One trial: who does what where, and its first numbers. */
export interface TrialLine {
  readonly key: string;
  readonly condition: string;
  readonly scene: string;
  readonly tct_s: number | null;
  readonly nct_s: number | null;
  readonly captures: number;
  readonly peaked_share: number | null;
  readonly tracking_losses: number;
}

/** A participant as the console shows them. */
export interface ParticipantLine {
  readonly participant: string;
  readonly state: 'done' | 'excluded' | 'running' | 'waiting';
  readonly current: string | null;
  readonly excluded: string | null;
  readonly images: boolean;
  readonly on_phone: boolean;
  readonly steps: readonly StepLine[];
  readonly trials: readonly TrialLine[];
  readonly notes: readonly string[];
}

/** Every event of the console's stream. */
export interface ConsoleState {
  readonly type: 'ConsoleState';
  readonly title: string;
  readonly planned: number;
  readonly remarks: readonly string[];
  readonly phone_links: readonly string[];
  readonly participants: readonly ParticipantLine[];
}

/** PUT …/excluded, …/notes/{note} and …/steps/{step}/repetitions/{repetition} of the console. */
export interface Reason {
  readonly text: string;
}

/** The answer to PUT …/participants/{new} of the console, where `new` is the client's id. */
export interface NewParticipant {
  readonly participant: string;
}

export type StudyEvent = ParticipantState | ConsoleState;

export const choiceSchema: Schema<Choice> = /* @__PURE__ */ record<Choice>({
  value: text,
  text: text,
});

export const itemSchema: Schema<Item> = /* @__PURE__ */ record<Item>({
  id: text,
  text: text,
  kind: oneOf('choice', 'choices', 'number', 'rating', 'scale', 'text'),
  points: optional(integer(2, 11)),
  low: optional(text),
  high: optional(text),
  choices: optional(list(choiceSchema)),
  smallest: optional(number()),
  largest: optional(number()),
  optional: optional(flag),
  help: optional(text),
  reversed: optional(flag),
});

export const questionnaireSchema: Schema<Questionnaire> = /* @__PURE__ */ record<Questionnaire>({
  name: text,
  title: text,
  items: list(itemSchema, 1),
  instruction: optional(text),
  scoring: optional(oneOf('harus', 'items', 'mean', 'nasa_rtlx', 'nasa_tlx', 'sus')),
  prefix: optional(nullable(text)),
  source: optional(text),
});

export const captureSettingSchema: Schema<CaptureSetting> = /* @__PURE__ */ record<CaptureSetting>({
  overlay: oneOf('none', 'peaks'),
  guide: oneOf('none', 'plenoptic'),
  area_side_m: nullable(number()),
  session: nullable(text),
});

export const shownStepSchema: Schema<ShownStep> = /* @__PURE__ */ record<ShownStep>({
  key: text,
  kind: oneOf('ask', 'capture', 'consent', 'introduction', 'practice', 'review', 'scan'),
  running: flag,
  text: text,
  form: optional(nullable(questionnaireSchema)),
  draft: optional(dictionary(nullable(union(integer(), number(), text, list(text))))),
  capture: optional(nullable(captureSettingSchema)),
  over_camera: optional(flag),
});

export const participantStateSchema: Schema<ParticipantState> = /* @__PURE__ */ record<ParticipantState>({
  type: oneOf('ParticipantState'),
  participant: text,
  title: text,
  language: text,
  step: nullable(shownStepSchema),
  done: integer(),
  total: integer(),
  refused: optional(flag),
});

export const answersRefusedSchema: Schema<AnswersRefused> = /* @__PURE__ */ record<AnswersRefused>({
  type: text,
  title: text,
  status: integer(),
  detail: text,
  items: dictionary(text),
});

export const toldSchema: Schema<Told> = /* @__PURE__ */ record<Told>({
  kind: oneOf('CaptureBegun', 'CaptureEnded', 'GuideTold', 'PageGone', 'PeakedTold', 'TrackingFound', 'TrackingLost', 'ViewJoined', 'ViewTaken', 'ViewUndone'),
  id: text,
  step: text,
  time_s: number(0, 100000000000),
  capture: optional(nullable(text)),
  world_from_cam: optional(nullable(list(number(), 0, 12))),
  acknowledged_s: optional(nullable(number(0, 100000000000))),
  generated_s: optional(nullable(number(0, 100000000000))),
  peaked_share: optional(nullable(number(0, 1))),
  wrong_share: optional(nullable(number(0, 1))),
  unseen_share: optional(nullable(number(0, 1))),
  unfixable_share: optional(nullable(number(0, 1))),
  views: optional(nullable(integer(0, 1000000))),
  until_s: optional(nullable(number(0, 100000000000))),
  name: optional(nullable(text)),
  value: optional(nullable(number())),
});

export const stepLineSchema: Schema<StepLine> = /* @__PURE__ */ record<StepLine>({
  key: text,
  kind: oneOf('ask', 'capture', 'consent', 'introduction', 'practice', 'review', 'scan'),
  label: text,
  state: oneOf('done', 'running', 'waiting'),
  began_s: optional(nullable(number())),
  ended_s: optional(nullable(number())),
});

export const trialLineSchema: Schema<TrialLine> = /* @__PURE__ */ record<TrialLine>({
  key: text,
  condition: text,
  scene: text,
  tct_s: nullable(number()),
  nct_s: nullable(number()),
  captures: integer(),
  peaked_share: nullable(number()),
  tracking_losses: integer(),
});

export const participantLineSchema: Schema<ParticipantLine> = /* @__PURE__ */ record<ParticipantLine>({
  participant: text,
  state: oneOf('done', 'excluded', 'running', 'waiting'),
  current: nullable(text),
  excluded: nullable(text),
  images: flag,
  on_phone: flag,
  steps: list(stepLineSchema),
  trials: list(trialLineSchema),
  notes: list(text),
});

export const consoleStateSchema: Schema<ConsoleState> = /* @__PURE__ */ record<ConsoleState>({
  type: oneOf('ConsoleState'),
  title: text,
  planned: integer(),
  remarks: list(text),
  phone_links: list(text),
  participants: list(participantLineSchema),
});

export const newParticipantSchema: Schema<NewParticipant> = /* @__PURE__ */ record<NewParticipant>({
  participant: text,
});

export const studyEventSchema: Schema<StudyEvent> = /* @__PURE__ */ tagged<StudyEvent>({
  ParticipantState: participantStateSchema,
  ConsoleState: consoleStateSchema,
});
