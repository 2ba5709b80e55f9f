// Generated from src/peaking/server/wire.py by `make wire`; do not edit.

import {
  dictionary, flag, integer, list, nullable, number, oneOf, optional, record, tagged, text, type
  Schema,
} from './schema';

/** Goes up when an older client would misunderstand; both sides refuse another version. */
export const PROTOCOL = 3;
/** Views that a client blends; `Options.neighbours` is never more. */
export const MAX_NEIGHBOURS = 8;
/** Targets that a person is asked to reach; a guide that needs more is refused. */
export const MAX_GUIDED_TARGETS = 400;
/** The paper's mean peaked share: below it, a view from here would not have been worth it. */
export const PAPER_PEAKED_SHARE = 0.0428;
/** Of a trace; goes up when an older reader would misunderstand. */
export const TRACE_VERSION = 1;
/** Of a trace's file: what can be attached to a bug report on GitHub. */
export const MAX_TRACE_BYTES = 25000000;
/** A client that hears nothing for so long takes the connection for dead, and connects again. */
export const SILENCE_S = 35;
/** Time constant with which what is shown follows what is measured, so that nothing flashes. */
export const SETTLING_S = 0.2;

/** Intrinsics in pixels, corner origin. */
export interface Pinhole {
  readonly width_px: number;
  readonly height_px: number;
  readonly fx_px: number;
  readonly fy_px: number;
  readonly cx_px: number;
  readonly cy_px: number;
}

/** Where a picture was taken from, and how its pixels look out. */
export interface Camera {
  readonly pinhole: Pinhole;
  readonly world_from_cam: readonly number[];
}

/** A depth map: 16-bit little-endian millimetres along +z, rows from the top, 0 = unknown. It covers the same field of view as the photo. */
export interface DepthLayout {
  readonly width_px: number;
  readonly height_px: number;
}

/** The first part of an upload: what the bytes after it are. An upload is `u32 little-endian length of the header | header as JSON | photo as JPEG | depth | points`. */
export interface CaptureHeader {
  readonly protocol: number;
  readonly camera: Camera;
  readonly time_s: number;
  readonly photo_bytes: number;
  readonly depth?: DepthLayout | null;
  readonly points?: number;
  readonly corrected_world_from_cam?: readonly number[] | null;
  readonly sent_s?: number | null;
  readonly automatic?: boolean;
}

/** One captured view, as the server holds it. */
export interface Capture {
  readonly id: string;
  readonly number: number;
  readonly camera: Camera;
  readonly time_s: number;
  readonly state: 'failed' | 'queued' | 'ready';
  readonly mpi_bytes?: number | null;
  readonly mpi_version?: number;
  readonly generator?: string | null;
  readonly guessed?: boolean;
  readonly problem?: string | null;
  readonly removed?: boolean;
  readonly ending?: 'erased' | 'set_aside' | 'undone' | null;
  readonly restorable?: boolean;
  readonly corrected_world_from_cam?: readonly number[] | null;
  readonly automatic?: boolean;
}

/** PATCH /api/v1/sessions/{session}/captures/{capture}: `null` brings it back. */
export interface CaptureChange {
  readonly ending: 'erased' | 'set_aside' | 'undone' | null;
}

/** What is asked of GET /api/v1/sessions/{session}/selection, after the question mark. */
export interface SelectionQuery {
  readonly policy?: 'all' | 'auto-shutter' | 'coverage' | 'every-nth' | 'farthest' | 'peaking' | 'plenoptic' | 'random' | 'sharpest' | 'threshold' | 'uniform';
  readonly views?: number | null;
  readonly threshold_share?: number;
  readonly spacing_m?: number | null;
  readonly seed?: number;
}

/** What a policy says of a capture. */
export interface CaptureDecision {
  readonly id: string;
  readonly number: number;
  readonly kept: boolean;
  readonly reason: string;
  readonly worth_db?: number | null;
  readonly sharpness?: number | null;
  readonly brightness?: number | null;
  readonly faults?: readonly ('blurred' | 'brighter' | 'darker')[];
}

/** How well a number of views shows the captures. */
export interface CurvePoint {
  readonly num_views: number;
  readonly psnr_db: number;
}

/** GET /api/v1/sessions/{session}/selection: the captures that a policy would keep. Captures without an MPI, and those whose scale is a guess, are not among them. */
export interface Selection {
  readonly policy: 'all' | 'auto-shutter' | 'coverage' | 'every-nth' | 'farthest' | 'peaking' | 'plenoptic' | 'random' | 'sharpest' | 'threshold' | 'uniform';
  readonly captures: readonly CaptureDecision[];
  readonly curve?: readonly CurvePoint[];
  readonly enough?: number | null;
}

/** What is asked of GET /api/v1/sessions/{session}/dataset.zip, after the question mark. */
export interface DatasetQuery {
  readonly views?: number | 'auto' | null;
  readonly format?: 'colmap' | 'colmap-text' | 'instant-ngp' | 'llff' | 'nerfstudio' | 'tum';
}

/** A pose from which a view helps. */
export interface GuidedPlace {
  readonly camera: Camera;
  readonly reason: string;
  readonly share: number;
  readonly picture?: string | null;
}

/** How complete a capture was. */
export interface ScoreAt {
  readonly views: number;
  readonly score: number;
}

/** GET /api/v1/sessions/{session}/guidance: where next, how complete it is, what is left. It is computed in the background, of the views whose MPI is ready; `GuidanceChanged` says when. */
export interface Guidance {
  readonly revision: number;
  readonly views: number;
  readonly score: number;
  readonly verdict: 'enough' | 'go on' | 'no more help';
  readonly curve: readonly ScoreAt[];
  readonly next: GuidedPlace | null;
  readonly left: readonly GuidedPlace[];
  readonly surface_m: readonly number[];
}

/** A view that Gaussians show less well than others. */
export interface WorstView {
  readonly capture: string;
  readonly number: number;
  readonly psnr_db: number;
  readonly suggestion: string;
}

/** GET /api/v1/sessions/{session}/training: 3D Gaussians that are trained on its views. */
export interface Training {
  readonly state: 'done' | 'failed' | 'none' | 'running' | 'stopped' | 'waiting';
  readonly step: number;
  readonly steps: number;
  readonly gaussians: number;
  readonly views: number;
  readonly held_out: number;
  readonly psnr_db: number | null;
  readonly elapsed_s: number;
  readonly remaining_s: number | null;
  readonly splat_version: number;
  readonly splat_format: 'ply' | 'spz';
  readonly splat_bytes: number;
  readonly worst: readonly WorstView[];
  readonly outdated: boolean;
  readonly problem: string | null;
}

/** PUT /api/v1/sessions/{session}/training: begin or go on, or stop. */
export interface TrainingChange {
  readonly state: 'running' | 'stopped';
}

/** Begin a session, or find it again: PUT /api/v1/sessions/{session}. */
export interface NewSession {
  readonly protocol: number;
  readonly name: string;
  readonly source: 'other' | 'replay' | 'virtual' | 'webxr';
  readonly device?: string;
}

/** PATCH /api/v1/sessions/{session}; what is left out stays. */
export interface SessionChange {
  readonly name?: string | null;
  readonly finished?: boolean | null;
  readonly deleted?: boolean | null;
}

/** One line of the list of sessions. */
export interface SessionSummary {
  readonly id: string;
  readonly name: string;
  readonly folder: string;
  readonly source: 'other' | 'replay' | 'virtual' | 'webxr';
  readonly device: string;
  readonly created_s: number;
  readonly finished: boolean;
  readonly captures: number;
  readonly ready: number;
  readonly peaked_share: number | null;
  readonly live: boolean;
  readonly deleted_s?: number | null;
  readonly damaged?: number;
  readonly restorable?: number;
  readonly thumbnails?: readonly string[];
}

/** A session with all its captures in order, removed ones too. */
export interface Session {
  readonly summary: SessionSummary;
  readonly captures: readonly Capture[];
}

/** What the photographer saw at one moment: at most one a second. Shares are of what was visible on the screen. Where marks are told apart, what is peaked is wrong or unseen; what is unfixable is neither. */
export interface PeakedSample {
  readonly time_s: number;
  readonly peaked_share: number;
  readonly views: number;
  readonly world_from_cam: readonly number[];
  readonly wrong_share?: number | null;
  readonly unseen_share?: number | null;
  readonly unfixable_share?: number | null;
}

/** PUT /api/v1/sessions/{session}/peaked/{batch}; and all of them, GET …/peaked. A sample is known by its time: one that is sent again is kept once. */
export interface PeakedSamples {
  readonly samples: readonly PeakedSample[];
}

/** How a client renders and compares; the fields are those of `peaking.options.Options` without those that say how the server computes. */
export interface Options {
  readonly pixels: number;
  readonly generator: 'adampi' | 'layered';
  readonly num_planes: number;
  readonly align: 'off' | 'paper' | 'robust';
  readonly neighbours: number;
  readonly blend_weights: 'overlap' | 'paper';
  readonly opacity: 'paper' | 'seen';
  readonly filling_views: number;
  readonly error_threshold: number;
  readonly shift_px: number;
  readonly compensate_exposure: boolean;
  readonly marks: 'apart' | 'paper';
  readonly align_poses?: boolean;
  readonly depth_model?: string | null;
}

/** GET /api/v1/server: the first thing a client asks. */
export interface ServerInfo {
  readonly protocol: number;
  readonly version: string;
  readonly options: Options;
  readonly recordings: readonly string[];
  readonly warm: boolean;
  readonly warm_share: number;
  readonly max_upload_bytes: number;
}

/** POST /api/v1/pair: a device shows the code of a link, and gets a credential of its own. */
export interface Pairing {
  readonly protocol: number;
  readonly code: string;
  readonly device: string;
  readonly name?: string;
  readonly cookie?: boolean;
}

/** The answer: the device may now use the server. */
export interface Paired {
  readonly device: string;
  readonly role: 'console' | 'device' | 'participant';
  readonly credential: string | null;
}

/** One device that may use the server. */
export interface PairedDevice {
  readonly id: string;
  readonly name: string;
  readonly role: 'console' | 'device' | 'participant';
  readonly participants: readonly string[];
  readonly paired_s: number;
  readonly seen_s: number;
  readonly this: boolean;
}

/** GET /api/v1/devices, the one seen last first. */
export interface PairedDevices {
  readonly devices: readonly PairedDevice[];
  readonly open: boolean;
}

/** POST /api/v1/devices/codes: a new code, which pairs one device within ten minutes. */
export interface PairingLink {
  readonly links: readonly string[];
  readonly qr_svg: string;
  readonly until_s: number;
}

/** One frame of a recording that is played as the camera. */
export interface RecordedFrame {
  readonly camera: Camera;
  readonly depth: DepthLayout | null;
}

/** A picture of a trace, in its own file. */
export interface TracedPicture {
  readonly width_px: number;
  readonly height_px: number;
}

/** Depth of a trace as the device gave it, in its own file: little-endian, row by row. */
export interface TracedDepth {
  readonly width_px: number;
  readonly height_px: number;
  readonly format: 'float32' | 'luminance-alpha' | 'unsigned-short';
  readonly metres_per_unit: number;
  readonly buffer_from_view: readonly number[];
}

/** One frame of a trace: what the device said, before anything is made of it. */
export interface TracedFrame {
  readonly time_ms: number;
  readonly began_ms: number;
  readonly took_ms: number;
  readonly world_from_view?: readonly number[] | null;
  readonly projection?: readonly number[] | null;
  readonly camera_px?: readonly number[] | null;
  readonly picture?: TracedPicture | null;
  readonly depth?: TracedDepth | null;
  readonly resets?: readonly (readonly number[] | null)[];
}

/** `trace.json` of a trace: docs/trace.md. */
export interface Trace {
  readonly version: number;
  readonly made_s: number;
  readonly told: Readonly<Record<string, string>>;
  readonly frames: readonly TracedFrame[];
}

/** GET /api/v1/recordings/{name}. Pictures are at `/api/v1/recordings/{name}/frames/{index}/photo` (JPEG or PNG), depths at `…/depth` (as in `DepthLayout`). */
export interface RecordingIndex {
  readonly name: string;
  readonly fps: number;
  readonly frames: readonly RecordedFrame[];
  readonly trace?: Trace | null;
}

/** The body of every response of 400 and above: RFC 9457, `application/problem+json`. */
export interface Problem {
  readonly type: string;
  readonly title: string;
  readonly status: number;
  readonly detail: string;
}

/** First event of /api/v1/sessions/{session}/events. */
export interface SessionState {
  readonly type: 'SessionState';
  readonly session: Session;
}

/** A capture was stored, its MPI got ready or failed, or it was removed. */
export interface CaptureChanged {
  readonly type: 'CaptureChanged';
  readonly capture: Capture;
}

/** Name, state or peaked share changed. */
export interface SessionChanged {
  readonly type: 'SessionChanged';
  readonly summary: SessionSummary;
}

/** There is newer guidance: GET /api/v1/sessions/{session}/guidance. */
export interface GuidanceChanged {
  readonly type: 'GuidanceChanged';
  readonly revision: number;
}

/** A training began, went on, has something to show, or ended. */
export interface TrainingChanged {
  readonly type: 'TrainingChanged';
  readonly training: Training;
}

/** First event of /api/v1/events, for the dashboard; `SessionChanged` follows. */
export interface SessionList {
  readonly type: 'SessionList';
  readonly sessions: readonly SessionSummary[];
  readonly problems?: readonly string[];
}

export type SessionEvent = SessionState | CaptureChanged | SessionChanged | GuidanceChanged | TrainingChanged;

export type ServerEvent = SessionList | SessionChanged;

export const pinholeSchema: Schema<Pinhole> = /* @__PURE__ */ record<Pinhole>({
  width_px: integer(1, 8192),
  height_px: integer(1, 8192),
  fx_px: number(0, 1000000),
  fy_px: number(0, 1000000),
  cx_px: number(-100000, 100000),
  cy_px: number(-100000, 100000),
});

export const cameraSchema: Schema<Camera> = /* @__PURE__ */ record<Camera>({
  pinhole: pinholeSchema,
  world_from_cam: list(number(-100000000, 100000000), 12, 12),
});

export const depthLayoutSchema: Schema<DepthLayout> = /* @__PURE__ */ record<DepthLayout>({
  width_px: integer(1, 8192),
  height_px: integer(1, 8192),
});

export const captureSchema: Schema<Capture> = /* @__PURE__ */ record<Capture>({
  id: text,
  number: integer(),
  camera: cameraSchema,
  time_s: number(),
  state: oneOf('failed', 'queued', 'ready'),
  mpi_bytes: optional(nullable(integer())),
  mpi_version: optional(integer()),
  generator: optional(nullable(text)),
  guessed: optional(flag),
  problem: optional(nullable(text)),
  removed: optional(flag),
  ending: optional(nullable(oneOf('erased', 'set_aside', 'undone'))),
  restorable: optional(flag),
  corrected_world_from_cam: optional(nullable(list(number(-100000000, 100000000), 12, 12))),
  automatic: optional(flag),
});

export const captureDecisionSchema: Schema<CaptureDecision> = /* @__PURE__ */ record<CaptureDecision>({
  id: text,
  number: integer(),
  kept: flag,
  reason: text,
  worth_db: optional(nullable(number())),
  sharpness: optional(nullable(number())),
  brightness: optional(nullable(number())),
  faults: optional(list(oneOf('blurred', 'brighter', 'darker'))),
});

export const curvePointSchema: Schema<CurvePoint> = /* @__PURE__ */ record<CurvePoint>({
  num_views: integer(),
  psnr_db: number(),
});

export const selectionSchema: Schema<Selection> = /* @__PURE__ */ record<Selection>({
  policy: oneOf('all', 'auto-shutter', 'coverage', 'every-nth', 'farthest', 'peaking', 'plenoptic', 'random', 'sharpest', 'threshold', 'uniform'),
  captures: list(captureDecisionSchema),
  curve: optional(list(curvePointSchema)),
  enough: optional(nullable(integer())),
});

export const guidedPlaceSchema: Schema<GuidedPlace> = /* @__PURE__ */ record<GuidedPlace>({
  camera: cameraSchema,
  reason: text,
  share: number(0, 1),
  picture: optional(nullable(text)),
});

export const scoreAtSchema: Schema<ScoreAt> = /* @__PURE__ */ record<ScoreAt>({
  views: integer(),
  score: number(0, 1),
});

export const guidanceSchema: Schema<Guidance> = /* @__PURE__ */ record<Guidance>({
  revision: integer(),
  views: integer(),
  score: number(0, 1),
  verdict: oneOf('enough', 'go on', 'no more help'),
  curve: list(scoreAtSchema),
  next: nullable(guidedPlaceSchema),
  left: list(guidedPlaceSchema, 0, 3),
  surface_m: list(number(-100000000, 100000000), 0, 1500),
});

export const worstViewSchema: Schema<WorstView> = /* @__PURE__ */ record<WorstView>({
  capture: text,
  number: integer(),
  psnr_db: number(),
  suggestion: text,
});

export const trainingSchema: Schema<Training> = /* @__PURE__ */ record<Training>({
  state: oneOf('done', 'failed', 'none', 'running', 'stopped', 'waiting'),
  step: integer(),
  steps: integer(),
  gaussians: integer(),
  views: integer(),
  held_out: integer(),
  psnr_db: nullable(number()),
  elapsed_s: number(),
  remaining_s: nullable(number()),
  splat_version: integer(),
  splat_format: oneOf('ply', 'spz'),
  splat_bytes: integer(),
  worst: list(worstViewSchema),
  outdated: flag,
  problem: nullable(text),
});

export const sessionSummarySchema: Schema<SessionSummary> = /* @__PURE__ */ record<SessionSummary>({
  id: text,
  name: text,
  folder: text,
  source: oneOf('other', 'replay', 'virtual', 'webxr'),
  device: text,
  created_s: number(),
  finished: flag,
  captures: integer(),
  ready: integer(),
  peaked_share: nullable(number()),
  live: flag,
  deleted_s: optional(nullable(number())),
  damaged: optional(integer()),
  restorable: optional(integer()),
  thumbnails: optional(list(text)),
});

export const sessionSchema: Schema<Session> = /* @__PURE__ */ record<Session>({
  summary: sessionSummarySchema,
  captures: list(captureSchema),
});

export const peakedSampleSchema: Schema<PeakedSample> = /* @__PURE__ */ record<PeakedSample>({
  time_s: number(0, 100000000000),
  peaked_share: number(0, 1),
  views: integer(0, 1000000),
  world_from_cam: list(number(-100000000, 100000000), 12, 12),
  wrong_share: optional(nullable(number(0, 1))),
  unseen_share: optional(nullable(number(0, 1))),
  unfixable_share: optional(nullable(number(0, 1))),
});

export const peakedSamplesSchema: Schema<PeakedSamples> = /* @__PURE__ */ record<PeakedSamples>({
  samples: list(peakedSampleSchema, 0, 100000),
});

export const optionsSchema: Schema<Options> = /* @__PURE__ */ record<Options>({
  pixels: integer(),
  generator: oneOf('adampi', 'layered'),
  num_planes: integer(),
  align: oneOf('off', 'paper', 'robust'),
  neighbours: integer(1, 8),
  blend_weights: oneOf('overlap', 'paper'),
  opacity: oneOf('paper', 'seen'),
  filling_views: integer(0),
  error_threshold: number(),
  shift_px: number(),
  compensate_exposure: flag,
  marks: oneOf('apart', 'paper'),
  align_poses: optional(flag),
  depth_model: optional(nullable(text)),
});

export const serverInfoSchema: Schema<ServerInfo> = /* @__PURE__ */ record<ServerInfo>({
  protocol: integer(),
  version: text,
  options: optionsSchema,
  recordings: list(text),
  warm: flag,
  warm_share: number(),
  max_upload_bytes: integer(),
});

export const pairedSchema: Schema<Paired> = /* @__PURE__ */ record<Paired>({
  device: text,
  role: oneOf('console', 'device', 'participant'),
  credential: nullable(text),
});

export const pairedDeviceSchema: Schema<PairedDevice> = /* @__PURE__ */ record<PairedDevice>({
  id: text,
  name: text,
  role: oneOf('console', 'device', 'participant'),
  participants: list(text),
  paired_s: number(),
  seen_s: number(),
  this: flag,
});

export const pairedDevicesSchema: Schema<PairedDevices> = /* @__PURE__ */ record<PairedDevices>({
  devices: list(pairedDeviceSchema),
  open: flag,
});

export const pairingLinkSchema: Schema<PairingLink> = /* @__PURE__ */ record<PairingLink>({
  links: list(text),
  qr_svg: text,
  until_s: number(),
});

export const recordedFrameSchema: Schema<RecordedFrame> = /* @__PURE__ */ record<RecordedFrame>({
  camera: cameraSchema,
  depth: nullable(depthLayoutSchema),
});

export const tracedPictureSchema: Schema<TracedPicture> = /* @__PURE__ */ record<TracedPicture>({
  width_px: integer(1, 8192),
  height_px: integer(1, 8192),
});

export const tracedDepthSchema: Schema<TracedDepth> = /* @__PURE__ */ record<TracedDepth>({
  width_px: integer(1, 8192),
  height_px: integer(1, 8192),
  format: oneOf('float32', 'luminance-alpha', 'unsigned-short'),
  metres_per_unit: number(0, 1000),
  buffer_from_view: list(number(), 16, 16),
});

export const tracedFrameSchema: Schema<TracedFrame> = /* @__PURE__ */ record<TracedFrame>({
  time_ms: number(0, 10000000),
  began_ms: number(0, 10000000),
  took_ms: number(0, 10000000),
  world_from_view: optional(nullable(list(number(), 16, 16))),
  projection: optional(nullable(list(number(), 16, 16))),
  camera_px: optional(nullable(list(integer(1, 8192), 2, 2))),
  picture: optional(nullable(tracedPictureSchema)),
  depth: optional(nullable(tracedDepthSchema)),
  resets: optional(list(nullable(list(number(), 16, 16)))),
});

export const traceSchema: Schema<Trace> = /* @__PURE__ */ record<Trace>({
  version: integer(),
  made_s: number(0, 100000000000),
  told: dictionary(text),
  frames: list(tracedFrameSchema, 1, 4000),
});

export const recordingIndexSchema: Schema<RecordingIndex> = /* @__PURE__ */ record<RecordingIndex>({
  name: text,
  fps: number(),
  frames: list(recordedFrameSchema),
  trace: optional(nullable(traceSchema)),
});

export const problemSchema: Schema<Problem> = /* @__PURE__ */ record<Problem>({
  type: text,
  title: text,
  status: integer(),
  detail: text,
});

export const sessionStateSchema: Schema<SessionState> = /* @__PURE__ */ record<SessionState>({
  type: oneOf('SessionState'),
  session: sessionSchema,
});

export const captureChangedSchema: Schema<CaptureChanged> = /* @__PURE__ */ record<CaptureChanged>({
  type: oneOf('CaptureChanged'),
  capture: captureSchema,
});

export const sessionChangedSchema: Schema<SessionChanged> = /* @__PURE__ */ record<SessionChanged>({
  type: oneOf('SessionChanged'),
  summary: sessionSummarySchema,
});

export const guidanceChangedSchema: Schema<GuidanceChanged> = /* @__PURE__ */ record<GuidanceChanged>({
  type: oneOf('GuidanceChanged'),
  revision: integer(),
});

export const trainingChangedSchema: Schema<TrainingChanged> = /* @__PURE__ */ record<TrainingChanged>({
  type: oneOf('TrainingChanged'),
  training: trainingSchema,
});

export const sessionListSchema: Schema<SessionList> = /* @__PURE__ */ record<SessionList>({
  type: oneOf('SessionList'),
  sessions: list(sessionSummarySchema),
  problems: optional(list(text)),
});

export const sessionEventSchema: Schema<SessionEvent> = /* @__PURE__ */ tagged<SessionEvent>({
  SessionState: sessionStateSchema,
  CaptureChanged: captureChangedSchema,
  SessionChanged: sessionChangedSchema,
  GuidanceChanged: guidanceChangedSchema,
  TrainingChanged: trainingChangedSchema,
});

export const serverEventSchema: Schema<ServerEvent> = /* @__PURE__ */ tagged<ServerEvent>({
  SessionList: sessionListSchema,
  SessionChanged: sessionChangedSchema,
});
