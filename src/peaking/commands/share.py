"""`peaking share`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.share.place import SharedPlace
    from peaking.share.recorded_share import Figures
    from peaking.splat.training import TrainingStep

MB = 1_000_000
LEAST_MB = 1.0
LONGEST_ADDRESS = 500
"""Of a QR code that can be scanned from a screen."""


@dataclass(frozen=True)
class Share:
    """Write a scene to walk in as static files: a folder for any web server, or one HTML file.

    A light field is thinned to the views that show most, 3D Gaussians are pruned; what that costs
    is measured on the recording's pictures and said in dB. Pictures go without metadata, and what
    masks leave out is grey in them.

    Examples:
      peaking share scenes/desk --out desk.html
      peaking share ~/captures/garden --out garden --as both --licence "CC BY 4.0, A. Person"
      peaking share scenes/desk --out desk --as splat --splat desk.ply --max-mb 10
      peaking share garden.ply --out garden.html --address https://example.org/garden.html
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md; a session of `peaking serve` is one), an .mpi
    file, or 3D Gaussians: .ply, .spz, .glb, .gltf."""
    out: Path
    """A folder to write, new or empty or an earlier share; or a file ending in .html, which opens
    from the disk."""
    kind: Annotated[Literal["light-field", "splat", "both"], tyro.conf.arg(name="as")] = (
        "light-field"
    )
    """What of a recording is shown; 3D Gaussians are trained as `peaking splat` does it."""
    splat: Path | None = None
    """Gaussians that were trained on the recording (`peaking splat`); default: those that the
    server trained on a session, or else train now."""
    max_mb: float = 20.0
    """Megabytes of all files together, at most."""
    views: int | None = None
    """Views of the light field, at most; default: as many as fit."""
    title: str | None = None
    """Of the page; default: the scene's name."""
    licence: str = ""
    """A line under the picture: who may do what with it."""
    address: str | None = None
    """Where it will be found (https://…): shown as a QR code, on the page and here."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Share also what links lead to from outside the recording."""
    json: Path | None = None
    """Also write the sizes and the losses to this file, as JSON."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Write the files; say what was lost, and how to look at them."""
        from tqdm import tqdm

        from peaking.commands.results import write_results
        from peaking.server.serving import CLIENT_DIR
        from peaking.share.qr import qr_text
        from peaking.share.writing import check_out, is_single, write_place

        self._check()
        check_out(self.out)
        shared, figures = self._shared()
        shared = shared.named(self.title or shared.place.title, self.licence, self.address)
        with tqdm(shared.files, desc="writing", unit="file") as names:
            max_bytes = int(self.max_mb * MB)
            size = write_place(shared, self.out, CLIENT_DIR, names, max_bytes=max_bytes)
        say(f"{self.out}: {size / MB:.1f} MB", *_said(figures))
        if is_single(self.out):
            say(f"look at it: open {self.out.resolve().as_uri()}")
        else:
            say(f"look at it: python3 -m http.server -d {self.out}, then http://localhost:8000")
        if self.address is not None:
            say(f"{self.address}:")
            sys.stdout.write(qr_text(self.address))
        write_results(self, {"bytes": size, **asdict(figures)})

    @property
    def _is_mpi(self) -> bool:
        return self.scene.suffix.lower() == ".mpi"

    @property
    def _is_one_file(self) -> bool:
        from peaking.export.splats import is_splat_file

        return self._is_mpi or is_splat_file(self.scene)

    def _check(self) -> None:
        from urllib.parse import urlsplit

        if not LEAST_MB <= self.max_mb <= 1e6:
            raise ArgumentError(f"need --max-mb of {LEAST_MB:g} … 1000000, got {self.max_mb:g}")
        if self.views is not None and self.views < 1:
            raise ArgumentError(f"need --views of at least 1, got {self.views}")
        if self.splat is not None and self.kind == "light-field":
            raise ArgumentError("--splat needs --as splat or --as both")
        if self.views is not None and self.kind == "splat":
            raise ArgumentError("--views is for light fields: --as light-field or --as both")
        if self._is_one_file and (self.kind, self.views) != ("light-field", None):
            raise ArgumentError(f"--as, --views and --splat are for recordings, not {self.scene}")
        if self.address is not None:
            parts = urlsplit(self.address)
            if parts.scheme not in ("http", "https") or not parts.netloc:
                raise ArgumentError(
                    f"need an --address that begins with https://, got {self.address}"
                )
            if len(self.address) > LONGEST_ADDRESS:
                raise ArgumentError(f"need an --address of at most {LONGEST_ADDRESS} characters")

    def _shared(self) -> tuple[SharedPlace, Figures]:
        if not self._is_one_file:
            return self._of_recording()
        return self._of_mpi() if self._is_mpi else self._of_gaussians()

    def _of_mpi(self) -> tuple[SharedPlace, Figures]:
        from peaking.errors import OutputError
        from peaking.server.serving import CLIENT_DIR
        from peaking.share.file_place import place_of_mpi
        from peaking.share.recorded_share import RESERVE_BYTES, Figures
        from peaking.share.writing import room_for

        shared = place_of_mpi(self.scene)
        if room_for(shared, self.out, int(self.max_mb * MB), CLIENT_DIR) < RESERVE_BYTES:
            raise OutputError(f"{self.scene}: does not fit; allow more by --max-mb")
        return shared, Figures(views=1, of_views=1)

    def _of_gaussians(self) -> tuple[SharedPlace, Figures]:
        from peaking.export.splats import read_splats
        from peaking.server.serving import CLIENT_DIR
        from peaking.share.file_place import place_of_splats
        from peaking.share.recorded_share import RESERVE_BYTES, Figures
        from peaking.share.writing import room_for

        gaussians = read_splats(self.scene)
        bare = replace(place_of_splats(self.scene, gaussians)[0], files={})
        room = room_for(bare, self.out, int(self.max_mb * MB), CLIENT_DIR) - RESERVE_BYTES
        shared, kept = place_of_splats(self.scene, gaussians, room)
        return shared, Figures(gaussians=kept, of_gaussians=len(gaussians))

    def _of_recording(self) -> tuple[SharedPlace, Figures]:
        from tqdm import tqdm

        from peaking.server.serving import CLIENT_DIR
        from peaking.share.recorded_files import RecordedFiles
        from peaking.share.recorded_share import Wanted, share_recording
        from peaking.share.session_folder import trained_in

        with checked_arguments():
            options = self.method.options()
        recording = self.reading.open(self.scene, confined=not self.follow_links)
        files = RecordedFiles(recording, options)
        if self.kind != "splat" and not files.usable:
            raise ArgumentError(
                f"{self.scene}: has no depth, which a light field needs; take --as splat, or have "
                "depth estimated: --depth-model"
            )
        splat = self.splat
        if splat is None and self.kind != "light-field":
            splat = trained_in(recording)
            if splat is not None:
                say(f"Gaussians: those that were trained in the session ({splat.name})")
        wanted = Wanted(self.kind, self.out, int(self.max_mb * MB), CLIENT_DIR, self.views, splat)

        def shown(numbers: Sequence[int], what: str) -> Iterable[int]:
            return tqdm(numbers, desc=what, unit="frame")

        def trained(_: TrainingStep) -> None:
            bar.update()

        trains = self.kind != "light-field" and splat is None
        total = wanted.training.iterations if trains else 0
        with tqdm(total=total, desc="training", unit="step", disable=not trains) as bar:
            return share_recording(files, wanted, progress=shown, trained=trained)


def _said(figures: Figures) -> list[str]:
    said: list[str] = []
    if figures.views is not None:
        lost = _lost(figures.light_field_loss_db, "held-out pictures")
        if figures.light_field_loss_db is None and figures.views != figures.of_views:
            lost = "; what that costs is not known without measured depth"
        said.append(f"light field: {figures.views} of {figures.of_views} views{lost}")
    if figures.gaussians is not None:
        lost = _lost(figures.splat_loss_db, "the pictures")
        said.append(f"splat: {figures.gaussians} of {figures.of_gaussians} Gaussians{lost}")
    return said


def _lost(loss_db: float | None, where: str) -> str:
    if loss_db is None:
        return ""
    return f"; PSNR of {where} is {max(loss_db, 0.0):.2f} dB below the whole's"
