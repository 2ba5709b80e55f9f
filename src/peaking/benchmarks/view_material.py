"""What the viewer is measured with: a recording as a light field of 40 views, and its Gaussians."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np

from peaking.datasets import open_recording
from peaking.export.splats import read_splats, write_splats
from peaking.options import DEFAULT
from peaking.server.serving import CLIENT_DIR
from peaking.share import splat as shared_splats
from peaking.share.place import SharedPlace
from peaking.share.recorded_files import RecordedFiles
from peaking.share.recorded_share import Figures, Kind, Wanted, share_recording
from peaking.share.writing import write_place
from peaking.splat.gaussians import Gaussians
from peaking.splat.options import SplatOptions

MAX_BYTES = 20_000_000
VIEWS = 40

Told = Callable[[str], None]


class Material:
    """A recording's files, each made when it is first needed."""

    def __init__(self, scene: Path, folder: Path, splat: Path | None, told: Told) -> None:
        """Open the recording; make nothing yet.

        Args:
            scene: A recording with depth.
            folder: Empty; all is written there.
            splat: Gaussians that were trained on the recording; None: train them.
            told: Hears what is going on.

        Raises:
            RecordingError: It cannot be used.
        """
        self.scene = scene
        self.recording = recording = open_recording(scene)
        self.folder = folder
        self._splat = splat
        self._told = told
        self._files = RecordedFiles(recording, DEFAULT)

    def share(self, kind: Kind, out: Path, views: int | None = None) -> tuple[SharedPlace, Figures]:
        """Return what `peaking share --max-mb 20` would write."""
        splat = None if kind == "light-field" else self.gaussians
        self._told(f"sharing {self.recording.name} as {kind}")
        wanted = Wanted(kind, out, MAX_BYTES, CLIENT_DIR, views, splat)
        return share_recording(self._files, wanted)

    @cached_property
    def gaussians(self) -> Path:
        """A file of Gaussians that were trained on the recording."""
        if self._splat is not None:
            return self._splat
        options = SplatOptions()

        def trained(step: object) -> None:
            steps[0] += 1
            self._told(f"training Gaussians: {steps[0]} of {options.iterations}")

        steps = [0]
        frames = shared_splats.frames_of(self._files)
        made = shared_splats.trained(frames, self.recording.path, options, trained)
        path = self.folder / "trained.ply"
        write_splats(path, made)
        return path

    @cached_property
    def light_field(self) -> tuple[Path, Path]:
        """A light field of 40 views: the folder of it, and the page that opens from the disk."""
        folder, page = self.folder / "light_field", self.folder / "light_field.html"
        shared, _ = self.share("light-field", page, VIEWS)
        for out in (folder, page):
            write_place(shared, out, CLIENT_DIR)
        return folder, page

    @cached_property
    def splat_page(self) -> Path:
        """The Gaussians in a page that opens from the disk."""
        page = self.folder / "splat.html"
        write_place(self.share("splat", page)[0], page, CLIENT_DIR)
        return page

    def many_gaussians(self, count: int, seed: int) -> Path:
        """Return a file of so many Gaussians, as widely spread as those that were trained."""
        path = self.folder / "many.ply"
        write_splats(path, scattered(read_splats(self.gaussians), count, seed))
        return path


def scattered(gaussians: Gaussians, count: int, seed: int) -> Gaussians:
    """Return so many Gaussians around others, which cover about as much together.

    Args:
        gaussians: At least one.
        count: How many to return.
        seed: Of where they lie.

    Raises:
        ValueError: There is nothing to scatter, or nothing is asked for.
    """
    if len(gaussians) == 0 or count < 1:
        raise ValueError(f"need Gaussians and count >= 1, got {len(gaussians)} and {count}")
    random = np.random.default_rng(seed)
    of = random.integers(len(gaussians), size=count)
    scales_m = np.exp(gaussians.log_scales[of].mean(axis=1, keepdims=True))
    away_m = scales_m * random.standard_normal((count, 3), dtype=np.float32)
    smaller = np.float32(0.5 * np.log(min(len(gaussians) / count, 1.0)))
    return replace(
        gaussians,
        means_m=gaussians.means_m[of] + away_m,
        log_scales=gaussians.log_scales[of] + smaller,
        quaternions=gaussians.quaternions[of],
        opacity_logits=gaussians.opacity_logits[of],
        sh=gaussians.sh[of],
    )


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""


@contextmanager
def served(folder: Path) -> Generator[str, None, None]:
    """Serve a folder as any web server does; yield its address."""
    handler = functools.partial(_Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()
