# pyright: basic
# pyright: reportArgumentType=false, reportCallIssue=false
"""Surfaces of drawn scenes: wood, cloth, paper on the wall, pottery, leaves.

Each function draws an sRGB picture, `height width 3`, uint8, from the generator handed to it.
Nothing is downloaded, so the scene is our own work.
"""

import itertools

import cv2
import numpy as np

from peaking.photographers.drawn.drawing import (
    INK,
    fractal,
    phrase,
    shaded,
    smooth_noise,
    to_uint8,
    write_text,
)


def wood(
    rng: np.random.Generator,
    size: tuple[int, int],
    *,
    light: tuple[float, ...],
    dark: tuple[float, ...],
    boards: int = 5,
) -> np.ndarray:
    """Wood whose grain runs along the width, glued from `boards` boards."""
    height, width = size
    image = np.zeros((height, width, 3))
    edges = np.linspace(0, height, boards + 1).astype(int)
    for top, bottom in itertools.pairwise(edges):
        part = (bottom - top, width)
        y = np.linspace(-1, 1, part[0])[:, None] + rng.uniform(-0.6, 0.6)
        bend = smooth_noise(rng, part, (part[0] * 0.7, width / 5)) * 0.16
        rings = np.sin((np.abs(y + bend) ** 1.3) * rng.uniform(26, 40) + rng.uniform(0, 6))
        fibre = smooth_noise(rng, part, (1.3, 60)) * 0.5 + smooth_noise(rng, part, (3, 160)) * 0.5
        pores = np.clip(smooth_noise(rng, part, (1.2, 26)) - 1.5, 0, 1)
        mix = np.clip(0.42 + 0.15 * rings + 0.15 * fibre + rng.uniform(-0.14, 0.14), 0, 1)
        board = shaded(light, 1 - mix) + shaded(dark, mix)
        image[top:bottom] = board * (1 - 0.35 * pores[..., None])
        image[top : top + 2] *= 0.6
    return to_uint8(image)


def parquet(rng: np.random.Generator, size_px: int = 1536, planks: int = 14) -> np.ndarray:
    """A floor of staggered planks."""
    image = np.zeros((size_px, size_px, 3), np.uint8)
    edges = np.linspace(0, size_px, planks + 1).astype(int)
    for top, bottom in itertools.pairwise(edges):
        left = -int(rng.integers(0, 400))
        while left < size_px:
            right = left + int(rng.integers(380, 620))
            tone = rng.uniform(0.75, 1.15)
            light, dark = np.array((0.66, 0.47, 0.3)) * tone, np.array((0.4, 0.25, 0.14)) * tone
            board = wood(
                rng, (bottom - top, right - left), light=tuple(light), dark=tuple(dark), boards=1
            )
            board[:, :3] //= 3
            lo, hi = max(left, 0), min(right, size_px)
            image[top:bottom, lo:hi] = board[:, lo - left : hi - left]
            left = right
    return image


def rug(rng: np.random.Generator, size: tuple[int, int] = (1200, 1200)) -> np.ndarray:
    """A knotted rug: diamonds, borders and visible knots."""
    height, width = size
    y, x = np.mgrid[0:height, 0:width] / 60.0
    diamonds = (np.abs((x % 4) - 2) + np.abs((y % 4) - 2)) * 2.2
    index = (np.floor(diamonds) + 3 * np.floor(x / 4) + 5 * np.floor(y / 4)).astype(int) % 5
    colours = np.array(
        [
            (0.50, 0.22, 0.19),
            (0.22, 0.28, 0.37),
            (0.74, 0.67, 0.54),
            (0.64, 0.45, 0.27),
            (0.3, 0.38, 0.34),
        ]
    )
    image = colours[index]
    rim = np.minimum(np.minimum(x, width / 60 - x), np.minimum(y, height / 60 - y))
    stripes = np.floor(rim * 4).astype(int) % 3
    image = np.where((rim < 1.5)[..., None], colours[stripes], image)
    knots = 0.9 + 0.1 * np.sin(x * 60) * np.sin(y * 60)
    return to_uint8(
        image
        * (knots + 0.06 * smooth_noise(rng, size, (2, 2)) + 0.05 * fractal(rng, size, 200))[
            ..., None
        ]
    )


def wallpaper(rng: np.random.Generator, size_px: int = 1536) -> np.ndarray:
    """Warm wallpaper with a sprig pattern printed on rough paper (tiles once per 1.5 m)."""
    size = (size_px, size_px)
    image = shaded(
        (0.80, 0.76, 0.67),
        1 + 0.05 * fractal(rng, size, 300, 7) + 0.012 * smooth_noise(rng, size, (3, 3)),
    )
    step = size_px // 12
    for row in range(13):
        for col in range(13):
            x, y = int((col + 0.5 * (row % 2)) * step), row * step
            tone = (0.42, 0.5, 0.44) if (row + col) % 2 else (0.62, 0.42, 0.33)
            for angle in (-150, -90, -30):
                tip = (
                    int(x + 26 * np.cos(np.radians(angle))),
                    int(y + 26 * np.sin(np.radians(angle))),
                )
                cv2.ellipse(image, tip, (24, 9), angle, 0, 360, tone, -1, cv2.LINE_AA)
            cv2.line(image, (x, y), (x, y + 44), (0.4, 0.42, 0.36), 3, cv2.LINE_AA)
            cv2.circle(image, (x, y - 60), 6, (0.66, 0.3, 0.24), -1, cv2.LINE_AA)
    return to_uint8(image)


def ceiling_tiles(rng: np.random.Generator, size_px: int = 1024) -> np.ndarray:
    """Two by two acoustic tiles with holes."""
    image = (
        np.full((size_px, size_px, 3), 0.80)
        * (1 + 0.03 * fractal(rng, (size_px,) * 2, 100))[..., None]
    )
    for x, y in rng.integers(0, size_px, (2500, 2)):
        cv2.circle(
            image, (int(x), int(y)), int(rng.integers(1, 5)), (0.5, 0.49, 0.47), -1, cv2.LINE_AA
        )
    for line in (0, size_px // 2):
        image[line : line + 12] = image[:, line : line + 12] = 0.58
    return to_uint8(image)


def cloth(rng: np.random.Generator, size_px: int = 768) -> np.ndarray:
    """Woven plaid."""
    y, x = np.mgrid[0:size_px, 0:size_px]
    bands = np.array(
        [
            (0.23, 0.32, 0.38),
            (0.70, 0.65, 0.54),
            (0.54, 0.27, 0.23),
            (0.23, 0.32, 0.38),
            (0.32, 0.44, 0.42),
        ]
    )
    order = np.array([0, 0, 0, 1, 4, 4, 2, 2, 4, 1, 0, 3])
    weave = ((x // 2 + y // 2) % 2)[..., None]
    image = np.where(weave, bands[order[(x // 32) % 12]], bands[order[(y // 32) % 12]])
    thread = 0.9 + 0.12 * np.sin(x * np.pi / 2) * np.sin(y * np.pi / 2)
    return to_uint8(image * (thread + 0.05 * smooth_noise(rng, (size_px,) * 2, (2, 2)))[..., None])


def leaf(rng: np.random.Generator, size: tuple[int, int] = (256, 128)) -> np.ndarray:
    """A variegated leaf; the stalk is at the bottom, the tip at the top."""
    height, width = size
    y, x = np.mgrid[0:height, 0:width].astype(float)
    across = (x / width - 0.5) * 2
    veins = np.sin((y + np.abs(across) * 90) * 0.36) > 0.86
    patch = fractal(rng, size, 50, 4) + 1.2 * np.abs(across)
    image = np.where(
        (patch > 1.35)[..., None], np.array((0.77, 0.8, 0.5)), np.array((0.18, 0.42, 0.15))
    )
    image = image * (1 + 0.14 * fractal(rng, size, 12, 3))[..., None]
    image = np.where(
        (veins | (np.abs(across) < 0.05))[..., None],
        image * 0.6 + np.array((0.2, 0.26, 0.11)),
        image,
    )
    return to_uint8(image)


def glazed(
    rng: np.random.Generator, size: tuple[int, int], colours: list[tuple[float, ...]], *, rings: int
) -> np.ndarray:
    """Thrown pottery: glaze bands with speckles and a row of dabs."""
    height, width = size
    wave = smooth_noise(rng, size, (height, 40)) * 0.12
    index = np.floor(np.linspace(0, rings, height)[:, None] + wave).astype(int) % len(colours)
    image = np.array(colours)[index] * (1 + 0.05 * fractal(rng, size, 20))[..., None]
    for x in range(0, width, 44):
        cv2.circle(image, (x + 22, int(height * 0.42)), 14, colours[-1], -1, cv2.LINE_AA)
        cv2.circle(image, (x + 22, int(height * 0.42)), 6, colours[0], -1, cv2.LINE_AA)
    for x, y in rng.integers(0, (width, height), (width * height // 300, 2)):
        cv2.circle(image, (int(x), int(y)), 1, (0.25, 0.18, 0.14), -1, cv2.LINE_AA)
    return to_uint8(image)


def cardboard(rng: np.random.Generator, size: tuple[int, int] = (640, 800)) -> np.ndarray:
    """A parcel's side: fluted board, tape, a label with text and bars."""
    height, width = size
    flutes = 0.03 * np.sin(np.arange(width) * 0.9)[None]
    image = shaded(
        (0.66, 0.49, 0.32),
        1 + flutes + 0.05 * fractal(rng, size, 200) + 0.04 * smooth_noise(rng, size, (2, 9)),
    )
    image[height // 2 - 34 : height // 2 + 34] = image[
        height // 2 - 34 : height // 2 + 34
    ] * 0.4 + np.array((0.5, 0.42, 0.28))
    top, left = int(height * 0.56), int(width * 0.5)
    label = image[top : top + 230, left : left + 330]
    label[:] = (0.9, 0.9, 0.87)
    for k in range(4):
        write_text(label, phrase(rng, 3), (14, 36 + 30 * k), height_px=19, colour=INK)
    for x in range(14, 310, 6):
        cv2.rectangle(label, (x, 150), (x + int(rng.integers(1, 5)), 214), INK, -1)
    write_text(
        image, "FRAGILE", (40, height // 3), height_px=78, colour=(0.55, 0.13, 0.1), bold=True
    )
    write_text(image, "this side up", (44, height // 3 + 56), height_px=34, colour=INK)
    return to_uint8(image)


def globe_map(rng: np.random.Generator, size: tuple[int, int] = (400, 800)) -> np.ndarray:
    """A made-up planet with a graticule."""
    relief = fractal(rng, size, 150, 6)
    land = shaded((0.72, 0.62, 0.36), 1 + 0.25 * relief)
    image = np.where(
        (relief > 0.25)[..., None], land, shaded((0.16, 0.38, 0.56), 1 + 0.08 * relief)
    )
    image[::50] *= 0.75
    image[:, ::50] *= 0.75
    return to_uint8(image)


def plastic_grain(
    rng: np.random.Generator, colour: tuple[float, ...], size_px: int = 256
) -> np.ndarray:
    """Moulded plastic or brushed paint of one colour."""
    size = (size_px, size_px)
    return to_uint8(
        shaded(colour, 1 + 0.1 * smooth_noise(rng, size, (2, 2)) + 0.06 * fractal(rng, size, 60))
    )
