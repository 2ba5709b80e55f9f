# pyright: basic
# pyright: reportArgumentType=false, reportCallIssue=false
"""What the pictures of drawn scenes are drawn with: noise, colours and text.

Pictures are sRGB, `height width 3`. Randomness comes from the generator handed in.
"""

import cv2
import numpy as np

INK = (0.13, 0.13, 0.16)
WORDS = (  # noqa: SIM905
    "light field plane depth view ray focus lens scene near far layer alpha blend edge "
    "warp pose image colour pixel parallax window glass mirror desk garden river paper "
    "of the and in with from over under between to for is are we see a an by on at"
).split()
PALETTE = (
    np.array(
        [
            (176, 58, 46), (31, 97, 141), (20, 110, 85), (214, 160, 40), (108, 52, 131),
            (44, 62, 80), (202, 111, 30), (235, 226, 205), (130, 30, 50), (60, 125, 160),
            (90, 115, 60), (225, 190, 170), (38, 40, 46), (190, 195, 200), (150, 100, 70),
            (70, 150, 140), (200, 90, 110), (245, 240, 230),
        ]
    )
    / 255.0
)  # fmt: skip


def to_uint8(image: np.ndarray) -> np.ndarray:
    """Clip a 0..1 picture and store it in 8 bits."""
    return (np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def smooth_noise(
    rng: np.random.Generator, size: tuple[int, int], cell_px: tuple[float, float]
) -> np.ndarray:
    """Noise of mean 0 and deviation 1 whose blobs are `cell_px` (height, width) large."""
    grid = [max(2, round(n / c) + 1) for n, c in zip(size, cell_px, strict=True)]
    noise = cv2.resize(rng.standard_normal(grid), size[::-1], interpolation=cv2.INTER_CUBIC)
    return (noise - noise.mean()) / (noise.std() + 1e-9)


def fractal(
    rng: np.random.Generator, size: tuple[int, int], cell_px: float, octaves: int = 5
) -> np.ndarray:
    """Cloud-like noise: octaves from blobs of `cell_px` down, each half as strong."""
    total = sum(
        smooth_noise(rng, size, (max(1.0, cell_px / 2**k),) * 2) * 0.5**k for k in range(octaves)
    )
    return np.asarray(total / 1.15)


def shaded(colour: np.ndarray | tuple[float, ...], factor: np.ndarray) -> np.ndarray:
    """A flat colour times a brightness map."""
    return np.asarray(colour)[None, None, :] * factor[..., None]


def write_text(
    image: np.ndarray,
    text: str,
    at_px: tuple[float, float],
    *,
    height_px: float,
    colour: tuple[float, ...],
    bold: bool = False,
) -> float:
    """Draw a line of text whose baseline starts at `at_px` (x, y), clipped; returns its width."""
    size_px = round(height_px * 1.35)
    # Text can be drawn in 8 bits only: it is drawn as a mask.
    mask = np.zeros((2 * size_px, (len(text) + 2) * size_px), np.uint8)
    width = _put_text(mask, text, (0, int(1.5 * size_px)), size_px, bold)
    x, y = int(at_px[0]), int(at_px[1]) - int(1.5 * size_px)
    top, left = max(0, -y), max(0, -x)
    area = image[y + top : y + mask.shape[0], x + left : x + mask.shape[1]]
    alpha = mask[top : top + area.shape[0], left : left + area.shape[1], None] / 255.0
    area[:] = area * (1 - alpha) + np.asarray(colour) * alpha
    return float(width)


def _put_text(
    mask: np.ndarray, text: str, at_px: tuple[int, int], size_px: int, bold: bool
) -> float:
    """Write in OpenCV 5's sans, or in the strokes that OpenCV 4 has; return the width."""
    if hasattr(cv2, "FontFace"):
        weight = 700 if bold else 430
        (width, _), _ = cv2.putText(
            mask, text, at_px, (255,), cv2.FontFace("sans"), size_px, weight
        )
        return float(width)
    font, scale, thick = cv2.FONT_HERSHEY_SIMPLEX, size_px / 32, 2 if bold else 1
    cv2.putText(mask, text, at_px, font, scale, (255,), thick, cv2.LINE_AA)
    (width, _), _ = cv2.getTextSize(text, font, scale, thick)
    return float(width)


def phrase(rng: np.random.Generator, count: int) -> str:
    """A few words of filler text."""
    return " ".join(rng.choice(WORDS, count))
