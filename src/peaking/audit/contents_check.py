"""What of a picture the others do not show: something has moved, or stood in the way."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool

from peaking.datasets import Recording
from peaking.light_field import compare_with
from peaking.options import DEFAULT
from peaking.selection.recorded_frames import RecordedFrames

PIXELS = 48_000
"""At which pictures are predicted by others."""
VIEWS = 8
"""Near ones that a picture is predicted from."""
OPENED_PX = 3
"""Thinner lines are edges that are a pixel off, and nothing that has moved."""


@dataclass(frozen=True)
class Surprise:
    """What others do not show of a picture.

    Attributes:
        wrong_share: Of its pixels, 0…1.
        blob_share: Of its pixels, in the largest connected patch.
        marked: Where, at the size of the prediction.
    """

    wrong_share: float
    blob_share: float
    marked: Bool[np.ndarray, "h w"]


def surprises(
    recording: Recording,
    without: Collection[int],
    *,
    only: Sequence[int] | None = None,
    progress: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> dict[int, Surprise]:
    """Predict every picture with depth by others from nearby, and return what is wrong with it.

    Args:
        recording: With depth.
        without: Pictures that are predicted, but predict no other.
        only: Pictures that are predicted; all with depth where None.
        progress: Is given the numbers of the frames, and yields them.

    Raises:
        RecordingError: A frame cannot be read.
    """
    frames = RecordedFrames(recording, replace(DEFAULT, pixels=PIXELS), max_mpis=96)
    good = [i for i in frames.with_depth if i not in without]
    places = np.array([camera.position_m for camera in recording.cameras])
    forwards = np.array([camera.forward for camera in recording.cameras])
    found: dict[int, Surprise] = {}
    for i in progress(frames.with_depth if only is None else only):
        others = np.array([k for k in good if k != i], dtype=np.int64)
        if len(others) == 0:
            continue
        away = np.linalg.norm(places[others] - places[i], axis=1) / frames.depth_m
        away += np.linalg.norm(forwards[others] - forwards[i], axis=1)
        near = others[np.argsort(away, kind="stable")[:VIEWS]]
        frame = frames.frame(i)
        rendering = frames.render([int(k) for k in near], frame.camera)
        errors = compare_with(frames.options, rendering, frame.rgb).within(frame.mask)
        marked = errors.wrong | errors.unfixable
        opened = cv2.morphologyEx(
            marked.astype(np.uint8), cv2.MORPH_OPEN, np.ones((OPENED_PX, OPENED_PX), np.uint8)
        )
        _, _, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
        largest = int(stats[1:, cv2.CC_STAT_AREA].max(initial=0))
        found[i] = Surprise(
            float(marked.mean()), largest / marked.size, np.asarray(opened).astype(np.bool_)
        )
    return found
