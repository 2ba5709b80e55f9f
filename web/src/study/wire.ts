// Generated from src/peaking/server/study/wire.py by `make wire`; do not edit.
/* eslint-disable */

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

/** POST …/consent. */
export interface Consent {
  readonly agreed: boolean;
  readonly images?: boolean;
}

/** PUT …/draft: the answers that were changed, and only those. */
export interface Draft {
  readonly step: string;
  readonly answers: Readonly<Record<string, number | string | readonly string[] | null>>;
}

/** POST …/answers. */
export interface Answered {
  readonly step: string;
  readonly answers: Readonly<Record<string, number | string | readonly string[] | null>>;
}

/** The answer of status 422: what is wrong with which item (keys of the texts). */
export interface AnswersRefused {
  readonly problem: string;
  readonly items: Readonly<Record<string, string>>;
}

/** POST …/finish: the participant is done with a phase. */
export interface StepDone {
  readonly step: string;
}

/** POST …/session: the capture session of a step. */
export interface SessionBegun {
  readonly step: string;
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
  readonly missing_share?: number | null;
  readonly views?: number | null;
  readonly until_s?: number | null;
  readonly name?: string | null;
  readonly value?: number | null;
}

/** POST …/told. */
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

/** POST …/start and …/stop of the console. */
export interface StepOrder {
  readonly step: string;
}

/** POST …/repeat, …/note and …/exclude of the console. */
export interface Reason {
  readonly text: string;
  readonly step?: string | null;
}

/** The answer to POST …/participants of the console. */
export interface NewParticipant {
  readonly participant: string;
}

export type StudyEvent = ParticipantState | ConsoleState;
