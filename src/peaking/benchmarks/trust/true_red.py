"""Is what is wrong red, whatever the camera does meanwhile?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8

from peaking.benchmarks.trust.constructed import BAND_PX, MAKERS, Fault
from peaking.benchmarks.trust.disturbances import (
    ALL,
    DISTURBANCES,
    Turn,
    disturbance,
    moved,
    photographed,
    rolled,
)
from peaking.benchmarks.trust.judge import RULES, Change, Judge, Judgement, RuleName
from peaking.benchmarks.trust.scores import Detection, mean
from peaking.benchmarks.trust.stage import (
    RIGHT,
    VIEWS,
    WRONG,
    Stage,
    angle_rad,
    distance_m,
    grown,
    spread,
    true_error,
)
from peaking.geometry import Camera

PARALLAX_M = 0.05, 0.10, 0.20, 0.30
"""How far away the views are that a photograph is compared with."""

NEAR_ENOUGH = 0.25
"""Part of that by which a view may be nearer or farther."""

MAX_TURN_RAD = float(np.deg2rad(20.0))
PARALLAX_VIEWS = 3

NAMES = (*DISTURBANCES, ALL)


@dataclass(frozen=True)
class Question:
    """A picture in which something is wrong, and where.

    Attributes:
        kind: What is wrong.
        disturbance: What the camera did.
        live: The picture.
        told: Where the device says it was taken.
        change: What is done to the rendering; None if nothing.
        wrong: Pixels of `live` that are truly wrong.
        right: Those that are truly right; the rest does not count.
    """

    kind: str
    disturbance: str
    live: UInt8[np.ndarray, "h w 3"]
    told: Camera
    change: Change | None
    wrong: Bool[np.ndarray, "h w"]
    right: Bool[np.ndarray, "h w"]


Rule = Callable[[Question], Judgement]


class Tally:
    """What a rule found, by kind and disturbance."""

    def __init__(self) -> None:
        """Begin without a picture."""
        self._found: dict[tuple[str, str], Detection] = {}

    def add(self, question: Question, said: Judgement) -> None:
        """Count a picture."""
        key = question.kind, question.disturbance
        found = self._found.setdefault(key, Detection())
        found.add(said.score, said.red, question.wrong, question.right)

    def of(self, kind: str | None = None, disturbance: str | None = None) -> Detection:
        """Return what was found in pictures of a kind, under a disturbance; None is any."""
        total = Detection()
        for (own_kind, own_disturbance), found in self._found.items():
            if kind in (None, own_kind) and disturbance in (None, own_disturbance):
                total.merge(found)
        return total

    @property
    def kinds(self) -> list[str]:
        """The kinds of faults that there were."""
        return list(dict.fromkeys(kind for kind, _ in self._found))

    @property
    def disturbances(self) -> list[str]:
        """The disturbances that there were."""
        return list(dict.fromkeys(name for _, name in self._found))


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Compare pictures in which something is wrong; yield the result last, {} before it."""
    tallies: dict[RuleName, Tally] = {rule: Tally() for rule in RULES}
    for judge, question in questions(stage):
        said = judge.compare(question.live, question.told, change=question.change)
        for rule in RULES:
            tallies[rule].add(question, said[rule])
        yield {}
    yield result(tallies["ours"], tallies["paper"])


def result(ours: Tally, paper: Tally) -> dict[str, object]:
    """Return what two rules found in the same pictures.

    A kind of fault is counted over all disturbances at once, because a rule has one threshold for
    all. All else is the mean over kinds, so that small faults count as much as large ones; only the
    overall precision is that of all pixels together.
    """
    of_kinds = {kind: _of_ours(ours.of(kind), paper.of(kind)) for kind in paper.kinds}
    papers = {kind: _of_paper(paper.of(kind)) for kind in paper.kinds}
    names = {
        name: (
            _means([_of_ours(ours.of(kind, name), paper.of(kind, name)) for kind in paper.kinds]),
            _means([_of_paper(paper.of(kind, name)) for kind in paper.kinds]),
        )
        for name in paper.disturbances
    }
    return {
        **_means(list(of_kinds.values())),
        "precision": ours.of().precision,
        "kinds": of_kinds,
        "disturbances": {name: figures[0] for name, figures in names.items()},
        "paper": {
            **_means(list(papers.values())),
            "precision": paper.of().precision,
            "kinds": papers,
            "disturbances": {name: figures[1] for name, figures in names.items()},
        },
    }


def _means(kinds: list[dict[str, float | None]]) -> dict[str, float | None]:
    names = dict.fromkeys(name for kind in kinds for name in kind)
    return {
        name: mean([value for kind in kinds if (value := kind[name]) is not None]) for name in names
    }


def _of_ours(ours: Detection, paper: Detection) -> dict[str, float | None]:
    return _of_paper(ours) | {"recall_at_papers_precision": ours.recall_at(paper.precision)}


def _of_paper(found: Detection) -> dict[str, float | None]:
    return {"auc": found.auc, "recall": found.recall, "precision": found.precision}


def questions(stage: Stage) -> Iterator[tuple[Judge, Question]]:
    """Yield every fault at some held-out poses, under every disturbance."""
    numbers = stage.views(VIEWS)
    judge = stage.judge(numbers)
    for index in stage.close_to(numbers, stage.plan.constructed):
        camera = stage.frame(index).camera
        for kind, make in MAKERS.items():
            fault = make(judge.render(camera), stage.rng("true_red", index, kind))
            if fault is not None:
                yield from ((judge, q) for q in disturbed(stage, kind, index, fault))
        for away_m in PARALLAX_M:
            found = parallax(stage, index, away_m)
            if found is not None:
                kind = f"parallax_{100 * away_m:.0f}_cm"
                yield from ((found[0], q) for q in disturbed(stage, kind, index, found[1]))


def disturbed(stage: Stage, kind: str, index: int, fault: Fault) -> Iterator[Question]:
    """Yield a fault's picture under every disturbance."""
    camera = stage.frame(index).camera
    for name in NAMES:
        rng = stage.rng("true_red", index, kind, name)
        what = disturbance(name, rng)
        live, wrong, right = fault.live, fault.wrong, fault.right
        if what.rolling:
            sources_px = Turn.drawn(rng).sources_px(camera.pinhole)
            live = rolled(live, sources_px, smooth=True)
            wrong, right = (
                rolled(mask.astype(np.uint8), sources_px, smooth=False) > 0
                for mask in (wrong, right)
            )
        told = moved(camera, rng) if what.moved else camera
        live = photographed(live, what, rng)
        yield Question(kind, name, live, told, fault.change, wrong, right)


def parallax(stage: Stage, index: int, away_m: float) -> tuple[Judge, Fault] | None:
    """Return a photograph, compared with views that were taken so far away; None without such.

    Wrong is what looks different at the recorded pose, apart from a gain (`true_error`), of what
    these views have seen and is neither mirror, glass nor moving. Poses of real recordings are not
    exact: there a pixel has to be wrong, or right, both at the recorded pose and at the one that
    the method finds.
    """
    frame = stage.frame(index)
    around = [
        number
        for number in range(len(stage.scene.recording))
        if number != index
        and stage.scene.recording.has_depth[number]
        and abs(distance_m(stage.camera(number), frame.camera) / away_m - 1) <= NEAR_ENOUGH
        and angle_rad(stage.camera(number), frame.camera) <= MAX_TURN_RAD
    ]
    numbers = tuple(spread(around, PARALLAX_VIEWS))
    if not numbers:
        return None
    judge = stage.judge(numbers)
    seen, known = stage.seen_truth(numbers, index)
    counted = seen & known & (stage.materials(index) == 0)
    found = None if stage.scene.is_exact else judge.corrected(frame.rgb, frame.camera)
    errors = [
        true_error(judge.render(camera), frame.rgb, counted)
        for camera in (found, frame.camera)
        if camera is not None
    ]
    wrong = counted & (np.min(errors, axis=0) >= WRONG)
    right = counted & (np.max(errors, axis=0) <= RIGHT) & ~grown(wrong, BAND_PX)
    return judge, Fault(frame.rgb, None, wrong, right)
