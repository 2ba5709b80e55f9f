"""The process that trains 3D Gaussians on a session: its own, and the last to be served.

It is told what to do on its standard input, a line at a time (`pause`, `go on`, `stop`), stops when
that ends, and says how far it is on its standard output, as JSON.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import msgspec
import numpy as np

from peaking.errors import BackendUnavailable, PeakingError, SplatFileError
from peaking.frame import Frame, working_size_px
from peaking.server import wire
from peaking.splat.gaussians import Gaussians
from peaking.splat.options import SplatOptions
from peaking.splat.snapshot import read_snapshot, write_snapshot
from peaking.splat.training import Trainer

NICE = 15
SNAPSHOT = "snapshot.npz"
FIRST_PREVIEW_S = 2.0
"""After so long the first Gaussians are shown; the next after twice as long, and so on …"""
PREVIEW_EVERY_S = 15.0
"""… and at least so often."""
SNAPSHOT_EVERY_S = 20.0
SAID_EVERY_S = 0.5
HELD_OUT_EVERY = 8
"""Every so-manieth view is held out, where there are as many."""
LEAST_VIEWS = 3
WHOLE_TAKES = 2.5
"""Times as long as a step with pictures of half the size; measured on the desk."""
WORST = 3
FAR_BELOW_DB = 3.0
"""A view that is shown so much worse than the median wants more views …"""
BELOW_DB = 1.0
"""… and one that is so much worse, one more."""


class Task(msgspec.Struct, frozen=True):
    """What is to be trained.

    Attributes:
        folder: The session's.
        out: Where what comes out of it lies.
        captures: Ids of the session's captures by the number in their photo's name.
        version: Gaussians that are shown get higher numbers; one that was given once never comes
            again, so that nobody shows what was erased.
        goes_on: From the snapshot that lies in `out`.
        steps: Of all.
        pixels: Size in pixels to which photos are shrunk.
    """

    folder: str
    out: str
    captures: dict[int, str]
    version: int
    goes_on: bool
    steps: int
    pixels: int


class Progressed(msgspec.Struct, frozen=True, tag=True):
    """How far it is."""

    step: int
    gaussians: int
    views: int
    held_out: int
    remaining_s: float | None


class Shown(msgspec.Struct, frozen=True, tag=True):
    """There are newer Gaussians to show."""

    version: int
    format: wire.SplatFormat
    bytes: int


class Finished(msgspec.Struct, frozen=True, tag=True):
    """All steps were taken."""

    psnr_db: float | None
    worst: list[wire.WorstView]


class Stopped(msgspec.Struct, frozen=True, tag=True):
    """It stopped because it was told to; it can go on."""


class Failed(msgspec.Struct, frozen=True, tag=True):
    """It cannot be done."""

    problem: str


Said = Progressed | Shown | Finished | Stopped | Failed


def main(
    stdin: BinaryIO,
    say: Callable[[Said], None],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Train as the first line says, until it is done or told to stop."""
    with contextlib.suppress(OSError):
        os.nice(NICE)
    task = msgspec.json.decode(stdin.readline(), type=Task)
    orders = _Orders(stdin, clock)
    try:
        _Training(task, orders, say, clock).run()
    except PeakingError as error:
        say(Failed(str(error)))
    except MemoryError:
        say(Failed("there is not enough memory to train on so many views"))


class _Orders:
    """What the server wants, as it was last told."""

    def __init__(self, stdin: BinaryIO, clock: Callable[[], float]) -> None:
        self.stop = False
        self._clock = clock
        self._may_work = threading.Event()
        self._may_work.set()
        threading.Thread(target=self._listen, args=(stdin,), daemon=True).start()

    def wait(self) -> float:
        """Wait while there is something better to do; return for how long, seconds."""
        if self._may_work.is_set():
            return 0.0
        began_s = self._clock()
        self._may_work.wait()
        return self._clock() - began_s

    def _listen(self, stdin: BinaryIO) -> None:
        for line in stdin:
            match line.strip():
                case b"pause":
                    self._may_work.clear()
                case b"go on":
                    self._may_work.set()
                case _:
                    break
        self.stop = True  # told to, or the server is gone
        self._may_work.set()


@dataclass(frozen=True)
class _View:
    """A view that is trained on or held out."""

    capture: str
    number: int
    frame: Frame


class _Training:
    """One training, from reading the photos to the last Gaussians."""

    def __init__(
        self,
        task: Task,
        orders: _Orders,
        say: Callable[[Said], None],
        clock: Callable[[], float],
    ) -> None:
        self._task = task
        self._clock = clock
        self._orders = orders
        self._say = say
        self._out = Path(task.out)
        self._version = task.version
        self._options = SplatOptions(iterations=task.steps)
        if not task.goes_on:
            (self._out / SNAPSHOT).unlink(missing_ok=True)  # of other views
        self._views = _views(task, orders)
        held_out = range(0, len(self._views), HELD_OUT_EVERY)
        few = len(self._views) < HELD_OUT_EVERY
        self._held_out = [] if few else [self._views[index] for index in held_out]
        self._trained = [view for view in self._views if view not in self._held_out]

    def run(self) -> None:
        if self._orders.stop:
            self._say(Stopped())
            return
        trainer = self._trainer()
        began_s = shown_s = saved_s = said_s = self._clock()
        next_preview_s = FIRST_PREVIEW_S
        recent: deque[float] = deque(maxlen=50)
        while trainer.iteration < self._task.steps:
            paused_s = self._orders.wait()
            began_s, shown_s = began_s + paused_s, shown_s + paused_s
            if self._orders.stop:
                self._stop(trainer)
                return
            step_s = self._clock()
            trainer.step()
            now_s = self._clock()
            recent.append(now_s - step_s)
            if now_s - said_s >= SAID_EVERY_S:
                said_s = now_s
                remaining_s = self._remaining_s(trainer.iteration, float(np.mean(recent)))
                self._say(self._progress(trainer, remaining_s))
            if now_s - began_s >= next_preview_s or now_s - shown_s >= PREVIEW_EVERY_S:
                next_preview_s *= 2
                self._show(trainer.gaussians())
                shown_s = self._clock()
            if now_s - saved_s >= SNAPSHOT_EVERY_S:
                saved_s = now_s
                self._save(trainer)
        gaussians = trainer.gaussians()
        self._say(self._progress(trainer, 0.0))
        self._show(gaussians)
        judged = self._judged(gaussians)
        if judged is None:
            self._stop(trainer)
            return
        self._say(judged)
        (self._out / SNAPSHOT).unlink(missing_ok=True)

    def _stop(self, trainer: Trainer) -> None:
        self._save(trainer)
        self._say(Stopped())

    def _save(self, trainer: Trainer) -> None:
        self._refuse_gone()
        write_snapshot(self._out / SNAPSHOT, trainer.snapshot())

    def _refuse_gone(self) -> None:
        """Refuse to write where that would make the folder of an erased session again."""
        if not self._out.is_dir():
            raise SplatFileError("the session was deleted, or a photo of it erased")

    def _trainer(self) -> Trainer:
        from peaking.splat.initialisation import MIN_POINTS, surface_points

        if len(self._views) < LEAST_VIEWS:
            raise SplatFileError(f"need at least {LEAST_VIEWS} views to train on")
        frames = [view.frame for view in self._trained]
        points = surface_points(frames)
        if len(points) < MIN_POINTS:
            raise SplatFileError(
                "there is no depth, and no surface was found in two views: take views while moving "
                "sideways, with plenty of overlap"
            )
        trainer = Trainer(frames, self._options, points=points)
        if self._task.goes_on:
            # Damaged, or of other views: it begins again.
            with contextlib.suppress(SplatFileError, ValueError):
                trainer.go_on(read_snapshot(self._out / SNAPSHOT))
        return trainer

    def _remaining_s(self, iteration: int, step_s: float) -> float:
        """Return how long the rest takes, where steps take so long now."""
        steps = self._task.steps
        halves = max(0, round(self._options.half_size_share * steps) - iteration)
        wholes = steps - iteration - halves
        return step_s * (halves + wholes * (WHOLE_TAKES if halves else 1.0))

    def _progress(self, trainer: Trainer, remaining_s: float) -> Progressed:
        return Progressed(
            trainer.iteration,
            trainer.num_gaussians,
            len(self._trained),
            len(self._held_out),
            remaining_s,
        )

    def _show(self, gaussians: Gaussians) -> None:
        """Write Gaussians, in the session's axes, and let go of those before the last."""
        if not len(gaussians):
            return
        self._refuse_gone()
        version = self._version + 1
        path = _written(self._out, version, gaussians)
        self._version = version
        for old in self._out.glob("splat-*"):
            if not old.name.startswith((f"splat-{version}.", f"splat-{version - 1}.")):
                old.unlink(missing_ok=True)
        kind: wire.SplatFormat = "spz" if path.suffix == ".spz" else "ply"
        self._say(Shown(version, kind, path.stat().st_size))

    def _judged(self, gaussians: Gaussians) -> Finished | None:
        """Return how well views are shown; None where it is told to stop meanwhile."""
        by_view: list[tuple[float, _View]] = []
        for view in self._views:
            if self._orders.stop:
                return None
            by_view.append((_psnr_db(gaussians, view.frame), view))
        of_held_out = [db for db, view in by_view if view in self._held_out]
        median_db = float(np.median([db for db, _ in by_view]))
        worst = sorted(by_view, key=lambda each: each[0])[:WORST]
        return Finished(
            float(np.mean(of_held_out)) if of_held_out else None,
            [
                wire.WorstView(view.capture, view.number, db, suggestion_of(db, median_db))
                for db, view in worst
            ],
        )


def suggestion_of(psnr_db: float, median_db: float) -> str:
    """Return what would help a view that is shown so well, where the median is shown so well."""
    if psnr_db < median_db - FAR_BELOW_DB:
        return "Two more views from here would help."
    if psnr_db < median_db - BELOW_DB:
        return "One more view from here would help."
    return "As good as the others."


def _views(task: Task, orders: _Orders) -> list[_View]:
    """Return the views; not all where it is told to stop meanwhile."""
    from peaking.datasets import open_recording

    recording = open_recording(Path(task.folder))
    views: list[_View] = []
    for index in range(len(recording)):
        if orders.stop:
            break
        frame = recording.read(index)
        size_px = working_size_px(*frame.camera.pinhole.size_px, pixels=task.pixels)
        number = int(Path(frame.name).stem) if Path(frame.name).stem.isdigit() else index
        capture = task.captures.get(number)
        if capture is not None:
            # By its id, a snapshot knows it again.
            frame = replace(frame.resized(*size_px), name=capture)
            views.append(_View(capture, number, frame))
    return views


def _written(out: Path, version: int, gaussians: Gaussians) -> Path:
    """Write Gaussians as small as this installation can."""
    from peaking.export.splats import write_splats

    path = out / f"splat-{version}.spz"
    # Files have no room for an origin: the page counts from the session's own.
    shifted = replace(
        gaussians,
        means_m=(gaussians.means_m + gaussians.origin_m).astype(np.float32),
        origin_m=np.zeros(3),
    )
    try:
        write_splats(path, shifted)
    except BackendUnavailable:
        path = path.with_suffix(".ply")
        write_splats(path, shifted)
    return path


def _psnr_db(gaussians: Gaussians, frame: Frame) -> float:
    from peaking.metrics.psnr_ssim import psnr
    from peaking.splat.rasterise import render

    rgb = np.clip(render(gaussians, frame.camera).rgb, 0, 1).astype(np.float64)
    return psnr(rgb, frame.rgb / 255.0, frame.mask)


def _said_to(stdout: BinaryIO) -> Callable[[Said], None]:
    encoder = msgspec.json.Encoder()

    def say(said: Said) -> None:
        stdout.write(encoder.encode(said) + b"\n")
        stdout.flush()

    return say


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server says when to stop
    main(sys.stdin.buffer, _said_to(sys.stdout.buffer))
