"""Render the test views of a case, and compare them with their photographs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.experiments.reconstruct import Renderer
from peaking.experiments.results import ViewScore
from peaking.frame import Frame
from peaking.metrics.flip import flip_mean
from peaking.metrics.psnr_ssim import psnr, ssim
from peaking.output import encode_jpeg

SEEN = 0.5
"""Opacity from which a pixel counts as rendered."""

WORST = 3
"""So many of the worst views of a case are kept as pictures."""

MAX_PSNR_DB = 99.0
"""Of a picture without any difference, so that means stay finite."""

ERROR_GAIN = 2.0
"""Errors (mean over channels) are drawn so many times brighter."""

RIM_PX = 5
"""So far from the border SSIM looks."""

Distance = Callable[[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w 3"]], float]


@dataclass(frozen=True)
class Perceptual:
    """Learned distances between pictures, where their weights are at hand."""

    lpips: Distance | None = None
    st_lpips: Distance | None = None


def score_views(
    frames: Sequence[tuple[int, Frame]], render: Renderer, perceptual: Perceptual
) -> tuple[list[ViewScore], dict[int, bytes]]:
    """Score test views; return the scores, and pictures (JPEG) of the worst ones by view.

    Args:
        frames: Number and photograph of every test view, at the size to compare at.
        render: Draws what a camera sees.
        perceptual: Learned distances to add.
    """
    scores: list[ViewScore] = []
    rendered: list[Float32[np.ndarray, "h w 3"]] = []
    for index, frame in frames:
        rendering = render(frame.camera)
        rgb = np.clip(rendering.rgba[..., :3], 0.0, 1.0)
        photo = frame.rgb.astype(np.float32) / np.float32(255.0)
        mask = np.ones(rgb.shape[:2], np.bool_) if frame.mask is None else frame.mask
        counted = frame.mask if mask[RIM_PX:-RIM_PX, RIM_PX:-RIM_PX].any() else None
        rgb = np.where(mask[..., None], rgb, photo)  # what does not count is as it should be
        seen = (rendering.alpha > SEEN) & mask
        scores.append(
            ViewScore(
                view=index,
                psnr=min(psnr(rgb, photo, counted), MAX_PSNR_DB),
                ssim=ssim(rgb, photo, counted),
                flip=flip_mean(rgb, photo),
                lpips=perceptual.lpips(rgb, photo) if perceptual.lpips else None,
                st_lpips=perceptual.st_lpips(rgb, photo) if perceptual.st_lpips else None,
                psnr_seen=min(psnr(rgb, photo, seen), MAX_PSNR_DB) if seen.any() else None,
                coverage=float(seen.sum() / max(mask.sum(), 1)),
            )
        )
        rendered.append(rgb)
    order = np.argsort([score.psnr for score in scores], kind="stable")
    worst = [int(k) for k in order[:WORST]]
    pictures = {
        scores[k].view: encode_jpeg(_side_by_side(frames[k][1].rgb, rendered[k]), quality=85)
        for k in worst
    }
    return scores, pictures


def with_pictures(scores: Sequence[ViewScore], files: dict[int, str]) -> list[ViewScore]:
    """Return the scores with the names of their pictures."""
    return [replace(score, picture=files.get(score.view)) for score in scores]


def _side_by_side(
    photo: UInt8[np.ndarray, "h w 3"], rgb: Float32[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w3 3"]:
    """Return photograph, rendering and error (white on black) beside each other."""
    shown = (rgb * 255 + 0.5).astype(np.uint8)
    error = np.abs(photo.astype(np.float32) - rgb * 255).mean(axis=-1, keepdims=True)
    bright = np.clip(ERROR_GAIN * error, 0, 255).astype(np.uint8)
    return np.hstack([photo, shown, np.repeat(bright, 3, axis=-1)])
