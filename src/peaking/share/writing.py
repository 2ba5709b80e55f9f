"""Writes a place: a folder for any web server, or one file."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path

from peaking.errors import OutputError
from peaking.output import check_folder, complete_or_absent, write_atomically
from peaking.share import viewer_files
from peaking.share.place import FORMAT, QR_FILE, SharedPlace
from peaking.share.single_file import packed_bytes, page_with_place, with_title

PLACE_FILE, PAGE_FILE = "place.json", "index.html"
_OURS = frozenset(
    {
        PAGE_FILE,
        PLACE_FILE,
        QR_FILE,
        "points.bin",
        "poster.jpg",
        "splat.ply",
        "splat.spz",
        viewer_files.ASSETS,
        "mpis",
        "photos",
        "thumbnails",
    }
)
"""All that lies in the folder of a share."""


def is_single(out: Path) -> bool:
    """Return whether a place is to be one file, by its name."""
    return out.suffix.lower() in (".html", ".htm")


def room_for(shared: SharedPlace, out: Path, max_bytes: int, client_dir: Path) -> int:
    """Return how many bytes are left where so many are allowed: of files before they are packed.

    Args:
        shared: What is written in any case; of its views, files and loss nothing may grow.
        out: The folder, or the file.
        max_bytes: For all together.
        client_dir: The built web client.

    Raises:
        ToolMissing: It is not built.
    """
    sizes = [len(make()) for make in shared.files.values()]
    if is_single(out):
        bare = page_with_place(shared.place, {}, client_dir)
        return (max_bytes - len(bare) - sum(map(packed_bytes, sizes))) * 3 // 4
    viewer = _viewer(shared, client_dir).values()
    return max_bytes - sum(map(len, viewer)) - len(shared.place.to_json()) - sum(sizes)


def write_place(
    shared: SharedPlace,
    out: Path,
    client_dir: Path,
    progress: Iterable[str] | None = None,
    *,
    max_bytes: int | None = None,
) -> int:
    """Write a place, complete or not at all; return how many bytes it takes.

    Args:
        shared: The place.
        out: A file whose name ends in .html, which is replaced; or a folder, new or empty or an
            earlier share.
        client_dir: The built web client.
        progress: The names of its files, wrapped.
        max_bytes: A place that takes more is not written; None: any is.

    Raises:
        OutputError: The place is taken, full or not writable, or what is shared takes more bytes.
        ToolMissing: The web client is not built.
        PeakingError: A file of the place cannot be made.
    """
    names = list(shared.files) if progress is None else progress
    files = {name: shared.files[name]() for name in names}
    if is_single(out):
        data = page_with_place(shared.place, files, client_dir)
        _refuse_larger(out, len(data), max_bytes)
        write_atomically(out, data)
        return len(data)
    whole = {PLACE_FILE: shared.place.to_json(), **files, **_viewer(shared, client_dir)}
    size = sum(map(len, whole.values()))
    _refuse_larger(out, size, max_bytes)
    with _new_or_earlier(out) as folder:
        _write_all(folder, whole)
    return size


def check_out(out: Path) -> None:
    """Refuse, before any work, where `write_place` could not write.

    Raises:
        OutputError: It is such a place.
    """
    if is_single(out):
        if out.is_dir():
            raise OutputError(f"{out}: is a folder; give the name of a file")
        check_folder(out.parent)
        return
    check_folder(out)
    if out.is_dir() and any(out.iterdir()) and not _is_earlier_share(out):
        raise OutputError(
            f"{out}: holds other things than an earlier share; give a new folder or empty this one"
        )


def _refuse_larger(out: Path, size: int, max_bytes: int | None) -> None:
    if max_bytes is not None and size > max_bytes:
        raise OutputError(
            f"{out}: would take {size / 1e6:.2f} MB, and {max_bytes / 1e6:.2f} MB are allowed; "
            "allow more by --max-mb"
        )


def _viewer(shared: SharedPlace, client_dir: Path) -> dict[str, bytes]:
    page = with_title(viewer_files.page(client_dir), shared.place.title).encode()
    with_splats = shared.place.splat is not None
    return {PAGE_FILE: page, **viewer_files.assets(client_dir, with_splats=with_splats)}


def _write_all(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    # It is made for web servers: as open as what is made in it, and not private as other output.
    folder.chmod((folder / viewer_files.ASSETS).stat().st_mode & 0o777)


@contextlib.contextmanager
def _new_or_earlier(out: Path) -> Generator[Path, None, None]:
    """Yield a folder that takes the place of `out` when the block ends well."""
    check_out(out)
    if not out.is_dir() or not any(out.iterdir()):
        with complete_or_absent(out) as folder:
            yield folder
        return
    target = out.resolve()
    fresh, old = (target.with_name(f".{target.name}.{word}") for word in ("fresh", "old"))
    try:
        with complete_or_absent(fresh) as folder:
            yield folder
        target.rename(old)
        try:
            fresh.rename(target)
        except BaseException:
            old.rename(target)
            raise
    finally:
        for spare in (fresh, old):
            shutil.rmtree(spare, ignore_errors=True)


def _is_earlier_share(folder: Path) -> bool:
    """Return whether a folder holds a share and nothing else."""
    if not {entry.name for entry in folder.iterdir()} <= _OURS:
        return False
    with contextlib.suppress(OSError), (folder / PLACE_FILE).open("rb") as file:
        return FORMAT.encode() in file.read(200)
    return False
