"""Files of 3D Gaussians: .ply, compressed .ply, .spz, glTF; each with its own up.

.ply files are looked at with -y up (COLMAP's and Kerbl et al.'s axes; SuperSplat turns them so);
.spz (Niantic) and glTF have +y up. gsply writes and reads .spz and compressed .ply (extra
`formats`).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from peaking.errors import BackendUnavailable, OutputError, SplatFileError
from peaking.export.gltf import encode_gltf, read_gltf
from peaking.export.spz import check_spz
from peaking.export.up import Axis, turn
from peaking.limits import MAX_SPLAT_BYTES
from peaking.output import replaced
from peaking.splat.gaussians import Gaussians
from peaking.splat.ply import encode_ply, read_ply
from peaking.splat.rendering import C0
from peaking.splat.turning import turned

INSTALL = "pip install 'peaking[formats]', or take .ply or .glb"
SpzVersion = Literal[3, 4]
ENDINGS = (".ply", ".compressed.ply", ".spz", ".glb", ".gltf")
SPZ_BITS = 12
"""Of positions, behind the binary point: 0.24 mm, within 2 km."""


@dataclass(frozen=True)
class SplatFormat:
    """How a file of Gaussians is to be looked at.

    Attributes:
        up: The axis that points up.
        half_turn: About which axis up and down change places on the way to it: as Niantic (.spz)
            and PlayCanvas (.ply, glTF) do, so that scenes face the same way.
        off: How far positions may be off, as a share of the whole.
        colours_off: How far colours may be, of 1.
    """

    up: Axis
    half_turn: Literal["x", "z"]
    off: float = 0.0
    colours_off: float = 1e-6


_FORMATS = {
    ".ply": SplatFormat("-y", "z"),
    ".compressed.ply": SplatFormat("-y", "z", off=1e-3, colours_off=0.02),
    ".spz": SplatFormat("+y", "x", off=1e-3, colours_off=0.02),
    ".glb": SplatFormat("+y", "z"),
    ".gltf": SplatFormat("+y", "z"),
}


def ending_of(path: Path) -> str | None:
    """Return which of `ENDINGS` a name has, None without."""
    fitting = [ending for ending in ENDINGS if path.name.lower().endswith(ending)]
    return max(fitting, key=len, default=None)


def is_splat_file(path: Path) -> bool:
    """Return whether a path is a file of Gaussians, by its name."""
    return ending_of(path) is not None and path.is_file()


def check_writable(path: Path) -> None:
    """Find out before any work whether files of a name's ending can be written.

    Raises:
        OutputError: Its ending is of no format.
        BackendUnavailable: gsply is missing.
    """
    format_of(path)
    if ending_of(path) in _GSPLY:
        _gsply()


def upright(gaussians: Gaussians, up: Axis, path: Path) -> Gaussians:
    """Return Gaussians with the up of a file's format.

    Args:
        gaussians: Whose up is known.
        up: The axis that points up now.
        path: The file.
    """
    form = format_of(path)
    return turned(gaussians, turn(up, form.up, half_turn=form.half_turn))


def convert_splats(
    source: Path, out: Path, up: Axis | None = None, *, spz_version: SpzVersion = 3
) -> list[str]:
    """Read a file of Gaussians and write another; return what there is to say.

    Args:
        source: The file to read.
        out: The file to write, or to replace.
        up: The axis of the source that points up; its format's by default.
        spz_version: Of an .spz.

    Raises:
        SplatFileError: The source is no sound file of Gaussians.
        OutputError: The file cannot be written.
        BackendUnavailable: gsply is missing.
    """
    form, read_form = format_of(out), format_of(source)
    gaussians = read_splats(source)
    # Between two formats it is the same half turn there and back, by the one that is not .ply's.
    about = "x" if "x" in (form.half_turn, read_form.half_turn) else "z"
    gaussians = turned(gaussians, turn(up or read_form.up, form.up, half_turn=about))
    write_splats(out, gaussians, spz_version=spz_version)
    return said_of(out, gaussians)


def said_of(path: Path, gaussians: Gaussians) -> list[str]:
    """Return what there is to say of a file that was written."""
    size_mb = path.stat().st_size / 1e6
    said = [f"{path}: {len(gaussians)} Gaussians, {size_mb:.1f} MB"]
    if gaussians.origin_m.any():
        x, y, z = gaussians.origin_m
        where = {
            ".ply": " (comment origin_m in the file)",
            ".glb": " (asset.extras.origin_m in the file)",
            ".gltf": " (asset.extras.origin_m in the file)",
        }.get(ending_of(path) or "", "; the file does not say so")
        said.append(
            f"its coordinates are counted from ({x:.0f}, {y:.0f}, {z:.0f}), because files of "
            f"3D Gaussians have no room for numbers so large{where}"
        )
    return said


def write_splats(path: Path, gaussians: Gaussians, *, spz_version: SpzVersion = 3) -> None:
    """Write Gaussians, or replace the file; it is read back, and kept only if it says the same.

    Args:
        path: Its ending says the format.
        gaussians: In the axes of that format (`upright`).
        spz_version: Of an .spz.

    Raises:
        ValueError: There are no Gaussians.
        OutputError: The place is taken by a folder, full or not writable, or what was read back
            differs.
        BackendUnavailable: gsply is missing.
    """
    if not len(gaussians):
        raise ValueError("need at least one Gaussian")
    ending = ending_of(path)
    gsply = _gsply() if ending in _GSPLY else None
    if ending == ".compressed.ply":
        gaussians = _near_together(gaussians)
    with replaced(path) as partial:
        if gsply is None:
            encode = _ENCODERS[ending or ""]
            partial.write_bytes(encode(gaussians))
        elif ending == ".spz":
            _write_spz(gsply, partial, gaussians, spz_version)
        else:
            data = _to_gsply(gsply, gaussians)
            partial.write_bytes(gsply.compress_to_bytes(data))
        _check(path, _read(partial, ending or ""), gaussians)


def read_splats(path: Path) -> Gaussians:
    """Read a file of Gaussians, with all its degrees.

    Raises:
        SplatFileError: It is no sound file of Gaussians.
        BackendUnavailable: gsply is missing.
    """
    format_of(path)
    return _read(path, ending_of(path) or "")


def _read(path: Path, ending: str) -> Gaussians:
    try:
        size = path.stat().st_size
        if size > MAX_SPLAT_BYTES:
            raise SplatFileError(f"{path}: has more than {MAX_SPLAT_BYTES:,} bytes")
        if ending in (".glb", ".gltf"):
            return read_gltf(path, path.read_bytes())
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise SplatFileError(f"{path}: cannot be read ({error.strerror})") from error
    if ending in _GSPLY or b"element chunk" in head:
        return _read_by_gsply(path, ending)
    return read_ply(path, max_degree=3)


def _read_by_gsply(path: Path, ending: str) -> Gaussians:
    gsply = _gsply()
    try:
        if ending == ".spz":
            check_spz(path, INSTALL)
            data = gsply.read_spz(path)
        else:
            data = gsply.decompress_from_bytes(path.read_bytes())
        rest = np.zeros((len(data.means), 0, 3), np.float32) if data.shN is None else data.shN
        sh = np.concatenate([data.sh0[:, None], rest.reshape(len(data.means), -1, 3)], axis=1)
        return Gaussians(
            means_m=np.array(data.means, np.float32),
            log_scales=np.array(data.scales, np.float32),
            quaternions=np.array(data.quats, np.float32),
            opacity_logits=np.array(data.opacities, np.float32).reshape(-1),
            sh=np.array(sh, np.float32),
        )
    except (SplatFileError, BackendUnavailable):
        raise
    except Exception as error:  # damaged bytes raise anything
        raise SplatFileError(f"{path}: is no sound {ending} file ({error})") from error


def _write_spz(gsply: Any, path: Path, gaussians: Gaussians, version: SpzVersion) -> None:
    reach_m = float(np.abs(gaussians.means_m).max())
    bits = min(SPZ_BITS, 23 - max(0, int(np.ceil(np.log2(max(reach_m, 1.0) * 1.0001)))))
    if bits < 1:
        raise OutputError(f"{path}: .spz has no room for {reach_m:.3g} m; take .ply or .glb")
    try:
        gsply.write_spz(path, _to_gsply(gsply, gaussians), version=version, fractional_bits=bits)
    except ValueError as error:
        if "zstandard" in str(error):
            raise BackendUnavailable(f"zstandard is not installed: {INSTALL}") from error
        raise


def _to_gsply(gsply: Any, gaussians: Gaussians) -> Any:
    q = gaussians.quaternions.astype(np.float64)
    q /= np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-12)
    formats = gsply.create_ply_format(sh_degree=gaussians.degree)
    return gsply.GSData(
        means=gaussians.means_m,
        scales=gaussians.log_scales,
        quats=q.astype(np.float32),
        opacities=gaussians.opacity_logits,
        sh0=np.ascontiguousarray(gaussians.sh[:, 0]),
        shN=np.ascontiguousarray(gaussians.sh[:, 1:]),
        _format=formats,
    )


def _near_together(gaussians: Gaussians) -> Gaussians:
    """Return Gaussians in an order in which neighbours are near each other (Morton 1966).

    A compressed .ply counts the positions of 256 at a time from their own corner.
    """
    low = gaussians.means_m.min(axis=0)
    size = np.maximum(gaussians.means_m.max(axis=0) - low, 1e-12)
    cell = np.minimum((gaussians.means_m - low) / size * 1023, 1023).astype(np.uint32)
    key = np.zeros(len(cell), np.uint32)
    for bit in range(10):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1) << np.uint32(3 * bit + axis)
    order = np.argsort(key, kind="stable")
    names = ("means_m", "log_scales", "quaternions", "opacity_logits", "sh")
    return replace(gaussians, **{name: getattr(gaussians, name)[order] for name in names})


def _check(path: Path, got: Gaussians, wanted: Gaussians) -> None:
    """Compare what was read back: positions and colours."""
    form = format_of(path)
    extent_m = float(np.ptp(wanted.means_m, axis=0).max())
    problem = f"{len(got)} Gaussians of {len(wanted)}" if len(got) != len(wanted) else None
    if problem is None:
        off_m = float(np.abs(got.means_m - wanted.means_m).max())
        colours = [C0 * one.sh[:, 0] + 0.5 for one in (got, wanted)]
        most = form.colours_off
        off = float(np.abs(np.clip(colours[0], 0, 1) - np.clip(colours[1], 0, 1)).max())
        if not off_m <= form.off * extent_m + 2.0**-SPZ_BITS * (form.off > 0):
            problem = f"positions that are {off_m:.2g} m off"
        elif not off <= most:
            problem = f"colours that are {off:.2g} off"
    if problem is not None:
        raise OutputError(f"{path}: was read back with {problem}; nothing was kept")


def format_of(path: Path) -> SplatFormat:
    """Return how files of a name's ending are to be looked at.

    Raises:
        OutputError: Its ending is of no format.
    """
    ending = ending_of(path)
    if ending is None:
        raise OutputError(f"{path}: need a name that ends in one of {', '.join(ENDINGS)}")
    return _FORMATS[ending]


_GSPLY = (".spz", ".compressed.ply")
_ENCODERS: dict[str, Callable[[Gaussians], bytes]] = {
    ".ply": encode_ply,
    ".glb": lambda gaussians: encode_gltf(gaussians, binary=True),
    ".gltf": lambda gaussians: encode_gltf(gaussians, binary=False),
}


def _gsply() -> Any:
    try:
        return importlib.import_module("gsply")
    except ImportError as error:
        raise BackendUnavailable(f"gsply is not installed: {INSTALL}") from error
