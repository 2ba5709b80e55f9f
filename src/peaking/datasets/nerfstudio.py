"""Recordings as nerfstudio keeps them: transforms.json, pictures, and depth where there is any.

Frames without a depth map bring the points that they see of a point cloud: their own, or that of
the whole recording (`ply_file_path`).

All that can be wrong with a recording is found when it is opened, from transforms.json and the
headers of the files; pixels are decoded when a frame is read.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from peaking.datasets.depth_files import depth_size_px, read_depth
from peaking.datasets.depth_unit import MOST, depth_over_distance
from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.nerfstudio_subset import (
    as_written,
    files_of,
    is_remade,
    may_tell,
    tells,
    top_of_subset,
    write_depth,
    write_files,
)
from peaking.datasets.point_cloud import check_points, read_points
from peaking.datasets.recorded_views import RecordedView, refuse_twice, states_unit, view_of
from peaking.datasets.recording import GLASS, MIRROR
from peaking.datasets.stored_images import (
    as_handed_on,
    read_grey,
    read_mask,
    read_picture,
)
from peaking.datasets.text_tables import backwards
from peaking.datasets.transforms_json import (
    FILE_NAME,
    MILLIMETRE_M,
    UNIT,
    Fields,
    Json,
    file_of,
    frames_of,
    read_json,
)
from peaking.errors import OutputError, RecordingError
from peaking.frame import Frame, mask_resized
from peaking.geometry import Camera
from peaking.output import complete_or_absent
from peaking.pictures.metadata import is_removable
from peaking.point_cloud import visible_points

_KIND_BYTES = 16
"""Of a file's beginning: they tell its kind."""


@dataclass(frozen=True)
class NerfstudioRecording:
    """A folder of posed pictures, in the order they were taken (`datasets.recording.Recording`)."""

    root: Path
    """The folder that holds transforms.json."""
    views: tuple[RecordedView, ...]
    """One per picture."""
    top: Json
    """The fields of transforms.json that are about all frames."""
    confined: bool = False
    """No file is read through a link that leaves the folder."""

    def __len__(self) -> int:
        return len(self.views)

    @property
    def name(self) -> str:
        """The name of the folder."""
        return self.root.resolve().name

    @property
    def format(self) -> str:
        """What people call its format."""
        return "nerfstudio"

    @property
    def notes(self) -> Sequence[str]:
        """That NeRFCapture did not write its depth, or that time runs backwards in one file.

        All else that is wrong is refused.
        """
        unwritten = sum(
            view.depth is None and view.entry.get("depth_path") is not None for view in self.views
        )
        notes = backwards(self.timestamps_s) if self.path.name == FILE_NAME else []
        if unwritten:
            notes.append(
                f"depth of {unwritten} of {len(self)} frames is named, and was never written"
            )
        return tuple(notes)

    @property
    def path(self) -> Path:
        """The file that says what there is: transforms.json, or the first of several."""
        return file_of(self.root)

    @property
    def names(self) -> Sequence[str]:
        """Unique names that are good as file names: the pictures' own where these are unique."""
        return self._columns[0]

    @property
    def cameras(self) -> Sequence[Camera]:
        """Full-size cameras, without distortion."""
        return self._columns[1]

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """Times in seconds, None where the recording has none."""
        return self._columns[2]

    @property
    def has_depth(self) -> Sequence[bool]:
        """Which frames have a depth map in which anything is known.

        Raises:
            RecordingError: A depth map cannot be read: all are, when this is first asked.
        """
        return self._with_depth

    @cached_property
    def _with_depth(self) -> tuple[bool, ...]:
        return tuple(self._depth_m(view) is not None for view in self.views)

    @cached_property
    def _columns(
        self,
    ) -> tuple[tuple[str, ...], tuple[Camera, ...], tuple[float | None, ...]]:
        return (
            tuple(view.name for view in self.views),
            tuple(view.camera for view in self.views),
            tuple(view.timestamp_s for view in self.views),
        )

    def read(self, index: int) -> Frame:
        """Decode one picture, its depth and its mask, and take the lens's distortion out of them.

        A depth map in which nothing is known is none. Without one, `points_m` are the points of the
        view's own cloud, or those of the recording's that lie in the picture and are not hidden
        (`visible_points`).

        Raises:
            IndexError: There is no such view.
            RecordingError: A file is damaged or cut off, or is not what it was when the recording
                was opened.
        """
        view = self.views[index]
        path = self.root / view.picture
        rgb = read_picture(path, within=self._within)
        if (rgb.shape[1], rgb.shape[0]) != view.camera.pinhole.size_px:
            problem = "changed its size after the recording was opened"
            raise RecordingError(path, problem, remedy="open the recording again")
        depth_m, mask = self._depth_m(view), self._mask(view)
        return Frame(
            name=view.name,
            rgb=view.lens.undistorted(rgb),
            camera=view.camera,
            depth_m=None if depth_m is None else view.lens.undistorted_depth(depth_m),
            timestamp_s=view.timestamp_s,
            points_m=self._points_m(view),
            mask=None if mask is None else view.lens.undistorted_mask(mask),
        )

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return width and height of a frame's depth map, without decoding it; None without one."""
        depth = self.views[index].depth
        return None if depth is None else depth_size_px(self.root / depth, within=self._within)

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return the exact depth of a drawn scene (`exact_depth_file_path`, mm); else None.

        It has any size of the picture's aspect, and is 0 on mirror and glass (`materials`), whose
        first surface is not what a sensor, or a renderer, needs.

        Raises:
            RecordingError: A file cannot be read.
        """
        exact = self._fields(index).file("exact_depth_file_path")
        if exact is None:
            return None
        depth_mm = read_grey(self.root / exact, within=self._within)
        depth_m = depth_mm.astype(np.float32) / np.float32(1000.0)
        materials = self.materials(index)
        if materials is not None:
            size_px = depth_m.shape[1], depth_m.shape[0]
            at_depth = cv2.resize(materials, size_px, interpolation=cv2.INTER_NEAREST_EXACT)
            depth_m[(at_depth == MIRROR) | (at_depth == GLASS)] = 0.0
        return depth_m

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return what each pixel of a drawn scene shows (`materials_file_path`); else None.

        0 is none of these: 1 mirror, 2 glass, 3 what moves between frames, 4 over-exposed.

        Raises:
            RecordingError: The file cannot be read.
        """
        labels = self._fields(index).file("materials_file_path")
        if labels is None:
            return None
        return read_grey(self.root / labels, within=self._within).astype(np.uint8)

    def group(self, index: int) -> str | None:
        """Return what a frame of a drawn scene is for (`group`: "view", "beside", …); else None.

        Raises:
            RecordingError: The field is no text.
        """
        return self._fields(index).text("group")

    def fingerprint(self) -> str:
        """Return a short name for transforms.json and the sizes of pictures and depth maps."""
        told = (file for file in self.root.glob("transforms*.json") if file.is_file())
        digest = hashlib.sha256(b"".join(file.read_bytes() for file in sorted(told)))
        for view in self.views:
            for name in (view.picture, view.depth, *([view.mask] if view.mask else [])):
                size = (self.root / name).stat().st_size if name else 0
                digest.update(f"{name}:{size};".encode())
        return digest.hexdigest()[:24]

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse beforehand what `write_subset` would refuse to copy.

        Raises:
            RecordingError: A file of one of the views is reached by a link that leaves the
                recording, or is of a kind whose metadata cannot be removed.
        """
        for name in files_of(self.path, self.top, [self.views[i] for i in indices]):
            source = self.root / name
            head = read_bytes(source, _KIND_BYTES, within=None if follow_links else self.root)
            if not keep_exif and may_tell(name) and not is_removable(head):
                raise tells(source, "is of a kind whose metadata cannot be removed")

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> NerfstudioRecording:
        """Write some views as a data set of its own, and return it opened.

        Pictures, depth maps, masks and point clouds are copied under their own names, pixels and
        numbers byte for byte (depth as OpenEXR or TIFF becomes .npy); all fields are kept, and
        every frame says as `source_index` which view it was. What was written is read back and
        compared; `out` appears only when it is complete.

        Args:
            indices: Of the views, in the order in which they are written.
            out: The folder, new or empty.
            follow_links: Copy also what links lead to from outside the recording.
            keep_exif: Keep metadata of the pictures: when, where and with what they were taken.

        Raises:
            ValueError: No indices, one twice, or one that is no view of the recording.
            RecordingError: A file of the recording cannot be read or is reached by a link that
                leaves it, or its metadata cannot be removed.
            OutputError: `out` is taken, full or not writable.
        """
        if len(indices) == 0 or len(set(indices)) != len(indices):
            raise ValueError(f"need at least one index and none twice, got {list(indices)}")
        if min(indices) < 0 or max(indices) >= len(self):
            raise ValueError(f"need indices in 0..{len(self) - 1}, got {list(indices)}")
        chosen = [self.views[i] for i in indices]
        meant = [as_written(view) for view in chosen]
        entries = [
            {**view.entry, "source_index": int(i)} for i, view in zip(indices, meant, strict=True)
        ]
        text = json.dumps({**top_of_subset(self.top, chosen), "frames": entries}, indent=1)
        names = files_of(self.path, self.top, chosen)
        within = None if follow_links else self.root
        with complete_or_absent(out) as folder:
            write_files(self.root, names, folder, within=within, keep_exif=keep_exif)
            for view in filter(is_remade, chosen):
                write_depth(view, self.root, folder, within=within)
            (folder / FILE_NAME).write_text(text, encoding="utf-8")
            written = _opened_again(folder, out, meant)
        return replace(written, root=out)

    def picture_bytes(self, index: int, *, keep_exif: bool = False) -> bytes | None:
        """Return a straight picture as it is stored (JPEG or PNG), without metadata.

        None where it has to be encoded, as `PosedRecording.picture_bytes` has it.

        Args:
            index: Of the frame.
            keep_exif: Leave metadata in.

        Raises:
            RecordingError: It cannot be read.
        """
        view = self.views[index]
        if view.lens.has_distortion:
            return None
        data = read_bytes(self.root / view.picture, within=self._within)
        return as_handed_on(data, keep_exif=keep_exif)

    def _fields(self, index: int) -> Fields:
        return Fields(self.path, self.views[index].entry, self.top, f"frames[{index}]")

    def _depth_m(self, view: RecordedView) -> Float32[np.ndarray, "h w"] | None:
        """Decode the depth map of a view as it is stored; None where nothing is known.

        What the mask leaves out is unknown.
        """
        if view.depth is None:
            return None
        depth_m = read_depth(self.root / view.depth, view.depth_unit_m, within=self._within)
        mask = self._mask(view)
        if depth_m is None or mask is None:
            return depth_m
        depth_m[~mask_resized(mask, depth_m.shape[1], depth_m.shape[0])] = 0.0
        return depth_m if depth_m.any() else None

    def _mask(self, view: RecordedView) -> Bool[np.ndarray, "h w"] | None:
        """Decode the mask of a view, at the size of the stored picture."""
        if view.mask is None:
            return None
        mask = read_mask(self.root / view.mask, within=self._within)
        return mask_resized(mask, *view.lens.pinhole.size_px)

    def _points_m(self, view: RecordedView) -> Float64[np.ndarray, "n 3"] | None:
        if view.points is None:
            return None
        if "ply_file_path" in view.entry:
            cloud = read_points(self.root / view.points, within=self._within)
            return cloud * view.points_unit_m
        return visible_points(self._cloud * view.points_unit_m, view.camera)

    @cached_property
    def _cloud(self) -> Float64[np.ndarray, "n 3"]:
        """The points of the whole recording, in the units of the file."""
        name = Fields(self.path, self.top, {}).file("ply_file_path") or Path()
        return read_points(self.root / name, within=self._within)

    @property
    def _within(self) -> Path | None:
        return self.root if self.confined else None


def recognises(path: Path) -> bool:
    """Return whether a folder holds a transforms.json, or transforms_train.json and the like."""
    return file_of(path).is_file()


def open_recording(root: Path, *, confined: bool = False) -> NerfstudioRecording:
    """Open a nerfstudio (or instant-ngp, or Blender) data set.

    Poses become OpenCV axes and metres: an `applied_scale` in the file is taken back. Intrinsics
    are those of the stored pictures, which may be a multiple of `w`, `h`. Depth in whole numbers
    that states no unit is in millimetres, unless pictures and poses say otherwise.

    Args:
        root: The folder that holds transforms.json.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    recording = _opened(root, confined=confined)
    _check_unit(recording)
    return recording


def _opened(root: Path, *, confined: bool = False) -> NerfstudioRecording:
    within = root if confined else None
    top = read_json(root, within=within)
    path = file_of(root)
    scale = Fields(path, top, {}).positive("applied_scale", 1.0)
    Fields(path, top, {}).check_paths()
    views = [view_of(root, fields, scale, within) for fields in frames_of(path, top)]
    refuse_twice(path, views)
    stems = Counter(view.name for view in views)
    if max(stems.values()) > 1:
        views = [replace(view, name=f"{i:05d}_{view.name}") for i, view in enumerate(views)]
    shared = {key: value for key, value in top.items() if key != "frames"}
    for cloud in dict.fromkeys(view.points for view in views if view.points is not None):
        check_points(root / cloud, within=within)
    return NerfstudioRecording(root, tuple(views), shared, confined)


def _check_unit(recording: NerfstudioRecording) -> None:
    """Refuse depth that states no unit and cannot be in millimetres."""
    unstated = [
        number
        for number, view in enumerate(recording.views)
        if view.depth is not None and not states_unit(recording._fields(number))
    ]
    ratio = depth_over_distance(unstated, recording.cameras, recording.read) if unstated else None
    if ratio is not None and not 1 / MOST < ratio < MOST:
        raise RecordingError(
            recording.path,
            f"is missing, and depth in millimetres would be {ratio:.3g} times as far away as "
            "pictures and poses say",
            field=UNIT,
            remedy=f"write the unit of depth in metres, here perhaps {MILLIMETRE_M / ratio:.2g}",
        )


def _opened_again(folder: Path, out: Path, chosen: Sequence[RecordedView]) -> NerfstudioRecording:
    """Open what was written and compare it with what was meant."""
    try:
        written = _opened(folder)
    except RecordingError as error:
        raise OutputError(f"{out}: does not open again ({error}); check the disk") from error
    same = len(written) == len(chosen) and all(
        got.picture == meant.picture
        and got.depth == meant.depth
        and got.lens == meant.lens
        and np.array_equal(got.camera.world_from_cam.matrix(), meant.camera.world_from_cam.matrix())
        for got, meant in zip(written.views, chosen, strict=True)
    )
    if not same:
        raise OutputError(f"{out}: was read back with other cameras or files; check the disk")
    return written
