"""The wire, written once: what phones and the server say to each other.

TypeScript is generated from this file (`make wire`), and a test fails when the generated file is
stale. `docs/protocol.md` tells the story; `server/openapi.py` lists the addresses. Axes, pixels
and units: CONVENTIONS.md. Phones turn WebXR's axes to OpenCV's before they send a pose.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta

from peaking import options as method
from peaking.export.names import DatasetFormat

PROTOCOL = 3
"""Goes up when an older client would misunderstand; both sides refuse another version."""

Id = Annotated[str, Meta(pattern=r"^[0-9a-z][0-9a-z-]{7,63}$(?!\n)")]
"""Made by the client (`crypto.randomUUID()`), so that whatever is sent twice is kept once.

In Python, unlike in JavaScript, `$` alone would let a line break at the end through.
"""

Name = Annotated[str, Meta(min_length=1, max_length=80)]
"""What a person calls a session. It never becomes a path."""

Size = Annotated[int, Meta(ge=1, le=8192)]
Positive = Annotated[float, Meta(gt=0, le=1e6)]
Share = Annotated[float, Meta(ge=0, le=1)]
Metres = Annotated[float, Meta(ge=-1e8, le=1e8)]
"""Coordinates of maps (UTM, geocentric) are within it."""

# Numbers of the protocol that our own client does not need.

MAX_POINTS = 20_000
"""Tracked points that come with one capture; WebXR gives none."""

MAX_PLACES_LEFT = 3
"""Places that guidance names as left."""

MAX_SURFACE_PLACES = 500
"""Places of the surface that guidance tells."""

MAX_THUMBNAILS = 4
"""Of a session in the list of sessions."""

PING_S = 10.0
"""A stream of events says something at least this often."""

# Numbers that both languages need. TypeScript has them from here.

MAX_NEIGHBOURS = 8
"""Views that a client blends; `Options.neighbours` is never more."""

MAX_GUIDED_TARGETS = 400
"""Targets that a person is asked to reach; a guide that needs more is refused."""

PAPER_PEAKED_SHARE = method.PAPER_PEAKED_SHARE
"""The paper's mean peaked share: below it, a view from here would not have been worth it."""

TRACE_VERSION = 1
"""Of a trace; goes up when an older reader would misunderstand."""

MAX_TRACE_BYTES = 25_000_000
"""Of a trace's file: what can be attached to a bug report on GitHub."""

SILENCE_S = 35.0
"""A client that hears nothing for so long takes the connection for dead, and connects again."""

SETTLING_S = 0.2
"""Time constant with which what is shown follows what is measured, so that nothing flashes."""

CONSTANTS = (
    "PROTOCOL",
    "MAX_NEIGHBOURS",
    "MAX_GUIDED_TARGETS",
    "PAPER_PEAKED_SHARE",
    "TRACE_VERSION",
    "MAX_TRACE_BYTES",
    "SILENCE_S",
    "SETTLING_S",
)

SourceKind = Literal["webxr", "virtual", "replay", "other"]
MpiState = Literal["queued", "ready", "failed"]
Ending = Literal["undone", "set_aside", "erased"]
"""How a capture left the data set: by the photographer, by the program, by right and for ever."""


class Struct(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of everything on the wire: fields that are not known are refused."""


class Pinhole(Struct, frozen=True):
    """Intrinsics in pixels, corner origin."""

    width_px: Size
    height_px: Size
    fx_px: Positive
    fy_px: Positive
    cx_px: Annotated[float, Meta(ge=-1e5, le=1e5)]
    cy_px: Annotated[float, Meta(ge=-1e5, le=1e5)]


Pose = Annotated[list[Metres], Meta(min_length=12, max_length=12)]
"""world_from_cam, `[R | t]` row by row (12 numbers), OpenCV axes of the camera, metres."""


class Camera(Struct, frozen=True):
    """Where a picture was taken from, and how its pixels look out."""

    pinhole: Pinhole
    world_from_cam: Pose


class DepthLayout(Struct, frozen=True):
    """A depth map: 16-bit little-endian millimetres along +z, rows from the top, 0 = unknown.

    It covers the same field of view as the photo.
    """

    width_px: Size
    height_px: Size


class CaptureHeader(Struct, frozen=True):
    """The first part of an upload: what the bytes after it are.

    An upload is `u32 little-endian length of the header | header as JSON | photo as JPEG | depth |
    points`.
    """

    protocol: int
    camera: Camera
    """Of the photo, at its full size."""
    time_s: Annotated[float, Meta(ge=0, le=1e11)]
    """When the shutter was pressed, seconds since 1970, by the phone's clock."""
    photo_bytes: Annotated[int, Meta(ge=1, le=64_000_000)]
    depth: DepthLayout | None = None
    points: Annotated[int, Meta(ge=0, le=MAX_POINTS)] = 0
    """How many tracked points follow: x, y, z in the world, metres, little-endian float32 each."""
    corrected_world_from_cam: Pose | None = None
    """Where the picture shows that it was taken, beside what the device says in `camera`."""
    sent_s: Annotated[float, Meta(ge=0, le=1e11)] | None = None
    """When this was sent, by the clock of `time_s`: so the server knows how long ago it was taken,
    whatever that clock says."""
    automatic: bool = False
    """Taken by an automatic shutter: the program may set it aside."""


class Capture(Struct, frozen=True):
    """One captured view, as the server holds it."""

    id: Id
    number: int
    """1, 2, 3 … in the order they arrived; never used again after an undo."""
    camera: Camera
    time_s: float
    state: MpiState
    """Whether its MPI can be fetched."""
    mpi_bytes: int | None = None
    mpi_version: int = 0
    """Of the newest MPI: 1, 2 …; each has an address of its own, and never changes. 0: none yet."""
    generator: str | None = None
    """Who made the newest MPI: `layered` at once, then perhaps a learned one."""
    guessed: bool = False
    """Its depths are estimated and their scale is not known yet; a view nearby will tell."""
    problem: str | None = None
    """When `failed`: why, and what to do about it. When `ready`: why no better MPI was made."""
    removed: bool = False
    """In no data set; `ending` says why. Its pictures are given out only while it is set aside."""
    ending: Ending | None = None
    restorable: bool = False
    """Removed, and PATCH can bring it back."""
    corrected_world_from_cam: Pose | None = None
    """Where the phone found that it was taken; a suggestion beside `camera`."""
    automatic: bool = False
    """Taken by an automatic shutter, and never brought back: the program may set it aside."""


class CaptureChange(Struct, frozen=True):
    """PATCH /api/v1/sessions/{session}/captures/{capture}: `null` brings it back."""

    ending: Ending | None


class SelectionQuery(Struct, frozen=True):
    """What is asked of GET /api/v1/sessions/{session}/selection, after the question mark."""

    policy: method.PolicyName = "peaking"
    views: Annotated[int, Meta(ge=1, le=100_000)] | None = None
    """How many; every policy needs it but `peaking`, which then keeps as many as are enough, `all`,
    `threshold` and `plenoptic`."""
    threshold_share: Annotated[float, Meta(ge=0, lt=1)] = method.PAPER_PEAKED_SHARE
    """Of `threshold` without a number: the peaked share above which a view is taken."""
    spacing_m: Positive | None = None
    """Of `plenoptic` without a number: metres between views."""
    seed: Annotated[int, Meta(ge=0, le=1_000_000)] = 0
    """Of `random`."""


class CaptureDecision(Struct, frozen=True):
    """What a policy says of a capture."""

    id: Id
    number: int
    kept: bool
    reason: str
    """Why, in a few words."""
    worth_db: float | None = None
    """Of a view that `peaking` keeps: how much worse the mean PSNR of all captures would be without
    it, each shown by the others."""
    sharpness: float | None = None
    """Over that of the captures from nearby: 1 is as sharp as these."""
    brightness: float | None = None
    """Over that of the captures from nearby."""
    faults: list[Literal["blurred", "brighter", "darker"]] = []
    """What is wrong with it beside the captures from nearby."""


class CurvePoint(Struct, frozen=True):
    """How well a number of views shows the captures."""

    num_views: int
    psnr_db: float
    """Predicted: mean PSNR of all captures, each shown by the best so many others; at least 30 for
    those that are among these."""


class Selection(Struct, frozen=True):
    """GET /api/v1/sessions/{session}/selection: the captures that a policy would keep.

    Captures without an MPI, and those whose scale is a guess, are not among them.
    """

    policy: method.PolicyName
    captures: list[CaptureDecision]
    curve: list[CurvePoint] = []
    """By `peaking`, in rising number of views."""
    enough: int | None = None
    """By `peaking` without a number of views: twice as many would bring less than 1 dB."""


class DatasetQuery(Struct, frozen=True):
    """What is asked of GET /api/v1/sessions/{session}/dataset.zip, after the question mark."""

    views: Annotated[int, Meta(ge=1, le=100_000)] | Literal["auto"] | None = None
    """The best so many, or as many as are enough, with selection.csv; all without it."""
    format: DatasetFormat = "nerfstudio"
    """Of the data set; what it has no room for is in notes.txt."""


Verdict = Literal["go on", "enough", "no more help"]
"""Whether to take more views: yes; it is enough; or what is left, no view will mend."""


class GuidedPlace(Struct, frozen=True):
    """A pose from which a view helps."""

    camera: Camera
    """Of a small picture with the views' field of view."""
    reason: str
    """Why, in a few words."""
    share: Share
    """How much of the picture a view from there would mend."""
    picture: str | None = None
    """What views show there now: a small JPEG, in base 64."""


class ScoreAt(Struct, frozen=True):
    """How complete a capture was."""

    views: int
    score: Share


class Guidance(Struct, frozen=True):
    """GET /api/v1/sessions/{session}/guidance: where next, how complete it is, what is left.

    It is computed in the background, of the views whose MPI is ready; `GuidanceChanged` says when.
    """

    revision: int
    """0: there is none yet, and none comes while no view is ready, or in a study."""
    views: int
    """How many views it is about."""
    score: Share
    verdict: Verdict
    curve: list[ScoreAt]
    """The score after each view, as far as it is known."""
    next: GuidedPlace | None
    """The one pose to go to; null where no view helps, or it is enough."""
    left: Annotated[list[GuidedPlace], Meta(max_length=MAX_PLACES_LEFT)]
    """What is left, the most first."""
    surface_m: Annotated[list[Metres], Meta(max_length=3 * MAX_SURFACE_PLACES)]
    """x, y, z of places in the world where views saw a surface, spread evenly."""


SplatFormat = Literal["spz", "ply"]


class WorstView(Struct, frozen=True):
    """A view that Gaussians show less well than others."""

    capture: Id
    number: int
    psnr_db: float
    suggestion: str
    """What would help, as a sentence."""


class Training(Struct, frozen=True):
    """GET /api/v1/sessions/{session}/training: 3D Gaussians that are trained on its views."""

    state: Literal["none", "waiting", "running", "stopped", "done", "failed"]
    """`waiting`: another training goes first. One that is stopped can go on."""
    step: int
    steps: int
    """Of all."""
    gaussians: int
    views: int
    """That are trained on …"""
    held_out: int
    """… and that are not, by which it is judged."""
    psnr_db: float | None
    """Mean over the views held out, at the end."""
    elapsed_s: float
    remaining_s: float | None
    splat_version: int
    """Of the newest Gaussians, GET …/training/splat/{version}; 0: there are none."""
    splat_format: SplatFormat
    splat_bytes: int
    worst: list[WorstView]
    """The views that are shown least well, at the end."""
    outdated: bool
    """Views came or went since it began."""
    problem: str | None


class TrainingChange(Struct, frozen=True):
    """PUT /api/v1/sessions/{session}/training: begin or go on, or stop."""

    state: Literal["running", "stopped"]


class NewSession(Struct, frozen=True):
    """Begin a session, or find it again: PUT /api/v1/sessions/{session}."""

    protocol: int
    name: Name
    source: SourceKind
    device: Annotated[str, Meta(max_length=400)] = ""
    """What the photographer's device calls itself."""


class SessionChange(Struct, frozen=True):
    """PATCH /api/v1/sessions/{session}; what is left out stays."""

    name: Name | None = None
    finished: bool | None = None
    """True: no photo that is taken from now on is taken in until it is false again, and those that
    were undone are deleted; until then they can be brought back."""
    deleted: bool | None = None
    """True deletes the whole session, for 30 days until it is erased; false brings it back."""


class SessionSummary(Struct, frozen=True):
    """One line of the list of sessions."""

    id: Id
    name: str
    folder: str
    """Its folder below the served one."""
    source: SourceKind
    device: str
    created_s: float
    finished: bool
    captures: int
    """Without the removed ones."""
    ready: int
    peaked_share: float | None
    """The last one told."""
    live: bool
    """A phone is connected now."""
    deleted_s: float | None = None
    """When it was deleted; it can be restored for 30 days."""
    damaged: int = 0
    """Records and samples on the server's disk that cannot be read and were left out."""
    restorable: int = 0
    """Removed captures that can be brought back."""
    thumbnails: list[Id] = []
    """Of at most `MAX_THUMBNAILS` captures, first to last, whose thumbnails stand for it."""

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing in it: such sessions are in no list."""
        return self.captures + self.restorable + self.damaged == 0


class Session(Struct, frozen=True):
    """A session with all its captures in order, removed ones too."""

    summary: SessionSummary
    captures: list[Capture]


class PeakedSample(Struct, frozen=True):
    """What the photographer saw at one moment: at most one a second.

    Shares are of what was visible on the screen. Where marks are told apart, what is peaked is
    wrong or unseen; what is unfixable is neither.
    """

    time_s: Annotated[float, Meta(ge=0, le=1e11)]
    peaked_share: Share
    """What a view from there would mend."""
    views: Annotated[int, Meta(ge=0, le=1_000_000)]
    world_from_cam: Pose
    wrong_share: Share | None = None
    """Seen, and shown wrongly; None: it was not told."""
    unseen_share: Share | None = None
    """What no view shows."""
    unfixable_share: Share | None = None
    """Wrong, and no view will help."""


class PeakedSamples(Struct, frozen=True):
    """PUT /api/v1/sessions/{session}/peaked/{batch}; and all of them, GET …/peaked.

    A sample is known by its time: one that is sent again is kept once.
    """

    samples: Annotated[list[PeakedSample], Meta(max_length=100_000)]


def _client_options() -> list[tuple[str, Any] | tuple[str, Any, Any]]:
    """Return the fields of `Options`: those of the method's options that a client needs."""
    types = get_type_hints(method.Options) | {
        "neighbours": Annotated[int, Meta(ge=1, le=MAX_NEIGHBOURS)],
        "filling_views": Annotated[int, Meta(ge=0)],
    }
    return [
        (option.name, types[option.name])
        if option.default is dataclasses.MISSING
        else (option.name, types[option.name], option.default)
        for option in dataclasses.fields(method.Options)
        if option.name not in method.MACHINE_OPTIONS
    ]


if TYPE_CHECKING:
    Options = method.Options
else:
    Options = msgspec.defstruct(
        "Options",
        _client_options(),
        bases=(Struct,),
        frozen=True,
        module=__name__,
        namespace={
            "__doc__": "How a client renders and compares; the fields are those of "
            "`peaking.options.Options` without those that say how the server computes."
        },
    )


def options_for_clients(options: method.Options) -> Options:
    """Return what clients are told of the method's options."""
    return Options(
        **{
            option.name: getattr(options, option.name)
            for option in dataclasses.fields(method.Options)
            if option.name not in method.MACHINE_OPTIONS
        }
    )


class ServerInfo(Struct, frozen=True):
    """GET /api/v1/server: the first thing a client asks."""

    protocol: int
    version: str
    options: Options
    recordings: list[str]
    """What can be played as the camera: GET /api/v1/recordings/{name}."""
    warm: bool
    """False while the server is still compiling: the first MPI waits until it is done."""
    warm_share: float
    """How much of that is done, 0…1."""
    max_upload_bytes: int


# Pairing


class Pairing(Struct, frozen=True):
    """POST /api/v1/pair: a device shows the code of a link, and gets a credential of its own."""

    protocol: int
    code: Annotated[str, Meta(min_length=1, max_length=200)]
    """What follows `#code=` in the link, or the server's fixed token."""
    device: Id
    """Made by the device, once; the same code from the same device gets the same answer."""
    name: Annotated[str, Meta(max_length=400)] = ""
    """What the device calls itself, for the list of devices."""
    cookie: bool = False
    """For browsers: the credential comes as a cookie, which no script can read."""


Role = Literal["device", "participant", "console"]


class Paired(Struct, frozen=True):
    """The answer: the device may now use the server."""

    device: str
    """Its id in the list of devices."""
    role: Role
    credential: str | None
    """To be sent as `Authorization: Bearer …`; null when it came as a cookie."""


class PairedDevice(Struct, frozen=True):
    """One device that may use the server."""

    id: str
    name: str
    role: Role
    participants: list[str]
    """Of a study: whose parts it may do."""
    paired_s: float
    seen_s: float
    this: bool
    """It is the device that asks."""


class PairedDevices(Struct, frozen=True):
    """GET /api/v1/devices, the one seen last first."""

    devices: list[PairedDevice]
    open: bool
    """The server serves its own machine only, and lets every program there in."""


class PairingLink(Struct, frozen=True):
    """POST /api/v1/devices/codes: a new code, which pairs one device within ten minutes."""

    links: list[str]
    """One for each address of the server, the likeliest first."""
    qr_svg: str
    """The first of them as a QR code, for an image."""
    until_s: float


class RecordedFrame(Struct, frozen=True):
    """One frame of a recording that is played as the camera."""

    camera: Camera
    depth: DepthLayout | None


Matrix = Annotated[list[float], Meta(min_length=16, max_length=16)]
"""4 x 4, column by column, as WebXR has them."""


class TracedPicture(Struct, frozen=True):
    """A picture of a trace, in its own file."""

    width_px: Size
    height_px: Size


class TracedDepth(Struct, frozen=True):
    """Depth of a trace as the device gave it, in its own file: little-endian, row by row."""

    width_px: Size
    height_px: Size
    format: Literal["luminance-alpha", "unsigned-short", "float32"]
    metres_per_unit: Annotated[float, Meta(gt=0, le=1e3)]
    buffer_from_view: Matrix
    """WebXR's `normDepthBufferFromNormView`."""


class TracedFrame(Struct, frozen=True):
    """One frame of a trace: what the device said, before anything is made of it."""

    time_ms: Annotated[float, Meta(ge=0, le=1e7)]
    """When the frame was for, since the first one."""
    began_ms: Annotated[float, Meta(ge=0, le=1e7)]
    """When the page was called for it."""
    took_ms: Annotated[float, Meta(ge=0, le=1e7)]
    """How long the recording of it held the page up."""
    world_from_view: Matrix | None = None
    """`XRView.transform`; null while tracking is lost."""
    projection: Matrix | None = None
    """`XRView.projectionMatrix`."""
    camera_px: Annotated[list[Size], Meta(min_length=2, max_length=2)] | None = None
    """Width and height of the camera's picture; the one that is kept may be smaller."""
    picture: TracedPicture | None = None
    """Null where none was kept of this frame."""
    depth: TracedDepth | None = None
    resets: list[Matrix | None] = []
    """Events `reset` of the reference space since the frame before: `transform`, where told."""


class Trace(Struct, frozen=True):
    """`trace.json` of a trace: docs/trace.md."""

    version: int
    made_s: Annotated[float, Meta(ge=0, le=1e11)]
    """Seconds since 1970."""
    told: dict[str, str]
    """What the browser says of itself."""
    frames: Annotated[list[TracedFrame], Meta(min_length=1, max_length=4000)]


class RecordingIndex(Struct, frozen=True):
    """GET /api/v1/recordings/{name}.

    Pictures are at `/api/v1/recordings/{name}/frames/{index}/photo` (JPEG or PNG), depths at
    `…/depth` (as in `DepthLayout`).
    """

    name: str
    fps: float
    frames: list[RecordedFrame]
    trace: Trace | None = None
    """The recording is one of these: `frames` is empty, `index` counts its frames, and depths are
    as in `TracedDepth`."""


class Problem(Struct, frozen=True):
    """The body of every response of 400 and above: RFC 9457, `application/problem+json`."""

    type: str
    """A URI by which programs tell problems apart; `about:blank`: the status says it all."""
    title: str
    """The same for every problem of the type."""
    status: int
    detail: str
    """For people: what is wrong this time and what to do."""


# Server-sent events. Every stream begins with the whole state, so nothing is lost by reconnecting.


class SessionState(Struct, frozen=True, tag="SessionState"):
    """First event of /api/v1/sessions/{session}/events."""

    session: Session


class CaptureChanged(Struct, frozen=True, tag="CaptureChanged"):
    """A capture was stored, its MPI got ready or failed, or it was removed."""

    capture: Capture


class SessionChanged(Struct, frozen=True, tag="SessionChanged"):
    """Name, state or peaked share changed."""

    summary: SessionSummary


class GuidanceChanged(Struct, frozen=True, tag="GuidanceChanged"):
    """There is newer guidance: GET /api/v1/sessions/{session}/guidance."""

    revision: int


class TrainingChanged(Struct, frozen=True, tag="TrainingChanged"):
    """A training began, went on, has something to show, or ended."""

    training: Training


class SessionList(Struct, frozen=True, tag="SessionList"):
    """First event of /api/v1/events, for the dashboard; `SessionChanged` follows."""

    sessions: list[SessionSummary]
    """Deleted ones too, while they can be restored; none in which there is nothing."""
    problems: list[str] = []
    """A sentence for each session that cannot be opened."""


SessionEvent = SessionState | CaptureChanged | SessionChanged | GuidanceChanged | TrainingChanged
ServerEvent = SessionList | SessionChanged
