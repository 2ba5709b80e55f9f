"""A video: its sharp pictures, each from a little farther on, and their poses from COLMAP.

Pictures are upright, as the file's note of a turn wants it, and their times are the video's own:
its rate may vary. HDR of the kind HLG is read as it is; of the kind PQ it is refused.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from peaking.datasets.cache import made_once
from peaking.datasets.foreign_files import opened
from peaking.datasets.found_poses import (
    AGAIN,
    Source,
    Unplaced,
    find_once,
    for_features,
    recording_in,
    shown_progress,
)
from peaking.datasets.posed_frames import PosedRecording, StoredPicture
from peaking.datasets.stored_images import read_picture
from peaking.datasets.video_choice import Chooser
from peaking.datasets.video_frames import VideoFile
from peaking.errors import RecordingError
from peaking.output import encode_jpeg
from peaking.poses.extra import imported
from peaking.poses.structure import Photograph

ENDINGS = (".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi")
MAX_FRAMES = 400
"""Where a video has more pictures worth having, they are taken twice as far apart."""
PICTURES = "pictures"
_PQ, _HLG = 16, 18
"""Transfer characteristics (ITU-T H.273, table 3)."""
_HEAD_BYTES = 1 << 24
_TO_SDR = (
    "convert it: ffmpeg -i FILE -vf zscale=t=linear:npl=100,tonemap=hable,"
    "zscale=p=bt709:t=bt709:m=bt709:r=tv,format=yuv420p OTHER"
)


def recognises(path: Path) -> bool:
    """Return whether a path is named like a video."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def open_recording(path: Path, *, confined: bool = False) -> PosedRecording:
    """Open a video; the first time its poses are looked for, which takes minutes.

    Args:
        path: The file.
        confined: Do not read it through a link that leaves its folder.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        RecordingError: It cannot be decoded, or its pictures cannot be joined.
    """
    within = path.parent if confined else None
    VideoFile(path, within=within)
    hlg = _transfer(path, within) == _HLG
    folder = made_once(path, "video", lambda out: _make(path, out, within))
    recording = recording_in(folder, path, "video", _source(folder), within=folder)
    if not hlg:
        return recording
    note = "it is HDR (HLG), and its colours are taken as they are"
    return replace(recording, notes=(*recording.notes, note))


def _make(path: Path, out: Path, within: Path | None) -> None:
    imported()
    if _transfer(path, within) == _PQ:
        raise RecordingError(path, "is HDR (PQ), whose colours are not converted", remedy=_TO_SDR)
    video = VideoFile(path, within=within, upright=True)
    chooser, times_s, sizes_px = Chooser(), dict[str, float](), dict[str, tuple[int, int]]()
    (out / PICTURES).mkdir()
    with shown_progress() as progress:

        def told(index: int) -> None:
            progress("choosing pictures", index, max(index, video.stated_frames))

        for shown in chooser.chosen(video.in_order(told)):
            name = f"{shown.index:06d}.jpg"
            (out / PICTURES / name).write_bytes(encode_jpeg(shown.rgb))
            times_s[name] = shown.time_s
            sizes_px[name] = shown.rgb.shape[1], shown.rgb.shape[0]
            if len(times_s) > MAX_FRAMES:
                chooser.coarser *= 2
                for thinned in list(times_s)[1::2]:
                    del times_s[thinned]
                    (out / PICTURES / thinned).unlink()
    if len(times_s) < 3:
        problem = f"shows the same place all the time: {len(times_s)} of its pictures differ"
        raise RecordingError(path, problem, remedy=AGAIN)
    pictures = [
        Unplaced(name, _photograph(out / PICTURES / name, sizes_px[name]), time_s)
        for name, time_s in times_s.items()
    ]
    find_once(out, path, pictures, _source(out), in_order=True)


def _source(folder: Path) -> Source:
    return lambda kept: StoredPicture(folder / PICTURES / kept.name, kept.size_px)


def _photograph(path: Path, size_px: tuple[int, int]) -> Photograph:
    return Photograph(lambda: for_features(read_picture(path)), size_px, str(size_px))


def _transfer(path: Path, within: Path | None) -> int | None:
    """Return how an MP4 or MOV says that its colours are encoded (ISO 14496-12, 12.1.5)."""
    with opened(path, within=within) as file:
        for place, whence in ((0, 0), (-_HEAD_BYTES, 2)):
            size = file.seek(0, 2)
            file.seek(max(place, -size), whence)
            found = re.search(rb"colrncl[xc]..(..)", file.read(_HEAD_BYTES), re.DOTALL)
            if found is not None:
                return int.from_bytes(found[1], "big")
    return None
