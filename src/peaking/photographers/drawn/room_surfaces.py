# pyright: basic
# pyright: reportArgumentType=false, reportCallIssue=false
"""Surfaces of the living room: plaster, stone, leather, carpet and cloth, many of them dark.

Each function draws an sRGB picture, `height width 3`, uint8, from the generator handed to it.
"""

import cv2
import numpy as np

from peaking.photographers.drawn.drawing import PALETTE, fractal, shaded, smooth_noise, to_uint8

Colour = tuple[float, float, float]


def plaster(rng: np.random.Generator, colour: Colour, size_px: int = 1024) -> np.ndarray:
    """A rolled wall with stains, strokes and small cracks."""
    size = (size_px, size_px)
    strokes = smooth_noise(rng, size, (3, 40)) * 0.015 + smooth_noise(rng, size, (40, 3)) * 0.015
    stains = 0.05 * fractal(rng, size, 260, 7) + strokes + 0.012 * smooth_noise(rng, size, (2, 2))
    image = shaded(colour, 1 + stains)
    for _ in range(9):
        at = rng.uniform(0, size_px, 2)
        path = at + np.cumsum(rng.normal(0, 7, (26, 2)) + rng.normal(0, 5, 2), axis=0)
        tone = tuple(0.8 * c for c in colour)
        cv2.polylines(image, [path.astype(np.int32)], False, tone, 1, cv2.LINE_AA)
    return to_uint8(image)


def damask(rng: np.random.Generator, colour: Colour, size_px: int = 1024) -> np.ndarray:
    """A dark wallpaper: ogees of a slightly lighter tone (tiles once per metre)."""
    v, u = np.mgrid[0:size_px, 0:size_px] * (2 * np.pi / size_px)
    ogee = np.cos(5 * u) + np.cos(4 * v) * np.cos(5 * u / 2) ** 2
    flower = np.cos(10 * u) * np.cos(8 * v)
    tone = 1 + 0.5 * (ogee > 0.7) + 0.35 * ((flower > 0.6) & (ogee < 0.2))
    tone = cv2.GaussianBlur(tone, (0, 0), 1.2)
    size = (size_px, size_px)
    return to_uint8(shaded(colour, tone * (1 + 0.07 * smooth_noise(rng, size, (2, 9)))))


def stone_tiles(rng: np.random.Generator, size_px: int = 1280, tiles: int = 4) -> np.ndarray:
    """Pale stone in squares, each with its own clouds and veins, with grey joints."""
    image = np.zeros((size_px, size_px, 3))
    step = size_px // tiles
    for row in range(tiles):
        for column in range(tiles):
            size = (step, step)
            cloud = fractal(rng, size, 120, 6)
            vein = np.exp(-((cloud - rng.uniform(-0.5, 0.5)) ** 2) / 0.004)
            base = np.array((0.78, 0.74, 0.68)) * rng.uniform(0.9, 1.06)
            tile = shaded(tuple(base), 1 + 0.07 * cloud - 0.22 * vein)
            tile[:5] = tile[:, :5] = (0.5, 0.49, 0.47)
            image[row * step : (row + 1) * step, column * step : (column + 1) * step] = tile
    return to_uint8(image)


def shag(
    rng: np.random.Generator, colour: Colour, size: tuple[int, int] = (1100, 1300)
) -> np.ndarray:
    """A long-haired carpet of one dark colour, with a lighter line along its rim."""
    hair = smooth_noise(rng, size, (2, 5)) * 0.22 + smooth_noise(rng, size, (6, 2)) * 0.2
    image = shaded(colour, np.clip(1 + hair + 0.16 * fractal(rng, size, 130, 5), 0.25, 2.2))
    cv2.rectangle(image, (70, 70), (size[1] - 71, size[0] - 71), (0.34, 0.3, 0.26), 14)
    return to_uint8(image)


def leather(rng: np.random.Generator, colour: Colour, size_px: int = 768) -> np.ndarray:
    """Worn leather: pores, creases, and paler places."""
    size = (size_px, size_px)
    crease = np.abs(fractal(rng, size, 70, 5)) < 0.06
    tone = 1 + 0.22 * fractal(rng, size, 220, 4) + 0.1 * smooth_noise(rng, size, (3, 3))
    return to_uint8(shaded(colour, np.clip(tone, 0.3, 2.0) * np.where(crease, 0.55, 1.0)))


def striped(rng: np.random.Generator, colours: tuple[int, ...], size_px: int = 640) -> np.ndarray:
    """Woven stripes of colours of the palette, of uneven width."""
    image, left = np.zeros((size_px, size_px, 3)), 0
    while left < size_px:
        right = left + int(rng.integers(14, 70))
        image[:, left:right] = PALETTE[rng.choice(colours)]
        left = right
    weave = 0.92 + 0.08 * np.sin(np.arange(size_px) * 1.4)[:, None]
    return to_uint8(image * (weave + 0.05 * smooth_noise(rng, (size_px,) * 2, (2, 2)))[..., None])


def cushion(rng: np.random.Generator, size_px: int = 420) -> np.ndarray:
    """Printed cloth: circles of three colours on a fourth."""
    ground, *inks = PALETTE[rng.permutation(len(PALETTE))[:4]]
    image = np.ones((size_px, size_px, 3)) * ground
    for row in range(6):
        for column in range(6):
            at = (column * 75 + (row % 2) * 37 + 10, row * 75 + 20)
            cv2.circle(image, at, 27, tuple(inks[(row + column) % 3]), -1, cv2.LINE_AA)
            cv2.circle(image, at, 11, tuple(inks[(row + 1) % 3]), -1, cv2.LINE_AA)
    return to_uint8(image * (1 + 0.06 * smooth_noise(rng, (size_px,) * 2, (2, 2)))[..., None])


def beach_ball(size: tuple[int, int] = (200, 720)) -> np.ndarray:
    """Six coloured sectors and white ones between them, with white caps."""
    colours = np.array(
        [(0.78, 0.16, 0.14), (0.93, 0.92, 0.88), (0.12, 0.34, 0.66), (0.93, 0.92, 0.88),
         (0.93, 0.72, 0.12), (0.93, 0.92, 0.88)]
    )  # fmt: skip
    image = np.repeat(colours[np.arange(size[1]) * 6 // size[1]][None], size[0], axis=0)
    image[:14] = image[-14:] = (0.93, 0.92, 0.88)
    return to_uint8(image)


def clock_face(size_px: int = 400) -> np.ndarray:
    """A clock on the wall, ten past ten."""
    image = np.full((size_px, size_px, 3), (0.92, 0.9, 0.84))
    middle = (size_px // 2, size_px // 2)
    for k in range(60):
        a = 2 * np.pi * k / 60
        inner, outer = (0.38 if k % 5 == 0 else 0.43) * size_px, 0.465 * size_px
        ends = [
            (int(middle[0] + r * np.sin(a)), int(middle[1] - r * np.cos(a))) for r in (inner, outer)
        ]
        cv2.line(image, *ends, (0.1, 0.1, 0.12), 7 if k % 5 == 0 else 2, cv2.LINE_AA)
    for turn, long, thick in ((10.17 / 12, 0.24, 11), (10 / 60, 0.36, 7)):
        a = 2 * np.pi * turn
        tip = (
            int(middle[0] + long * size_px * np.sin(a)),
            int(middle[1] - long * size_px * np.cos(a)),
        )
        cv2.line(image, middle, tip, (0.1, 0.1, 0.12), thick, cv2.LINE_AA)
    return to_uint8(image)
