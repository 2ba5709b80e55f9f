# pyright: basic
# pyright: reportCallIssue=false
"""Printed things of drawn scenes: pages, posters, book spines, keys, what a screen shows.

Each function draws an sRGB picture, `height width 3`, uint8, from the generator handed to it.
Nothing is downloaded, so the scene is our own work.
"""

import cv2
import numpy as np

from peaking.photographers.drawn.drawing import (
    INK,
    PALETTE,
    WORDS,
    fractal,
    phrase,
    shaded,
    smooth_noise,
    to_uint8,
    write_text,
)


def page(rng: np.random.Generator, size: tuple[int, int] = (842, 596)) -> np.ndarray:
    """A printed page: heading, two columns of words, a figure."""
    height, width = size
    image = (
        np.full((height, width, 3), (0.90, 0.89, 0.86))
        * (1 + 0.015 * fractal(rng, size, 80))[..., None]
    )
    write_text(image, phrase(rng, 4).title(), (40, 60), height_px=26, colour=INK, bold=True)
    write_text(image, phrase(rng, 6), (40, 88), height_px=13, colour=(0.35, 0.35, 0.4))
    figure = (int(rng.integers(0, 2)), int(rng.integers(150, 450)))
    for column in (0, 1):
        left, right = (
            40 + column * (width - 60) // 2,
            40 + column * (width - 60) // 2 + (width - 110) // 2,
        )
        y = 116
        while y < height - 40:
            if figure[0] == column and 0 <= y - figure[1] < 190:
                y += 190
                continue
            x = left + (14 if rng.random() < 0.1 else 0)
            while x < right - 34:
                x += (
                    int(
                        write_text(
                            image, str(rng.choice(WORDS)), (x, y), height_px=10.5, colour=INK
                        )
                    )
                    + 7
                )
            y += 17
    left, top = 40 + figure[0] * (width - 60) // 2, figure[1] + 4
    plot(rng, image[top : top + 170, left : left + (width - 110) // 2])
    return to_uint8(image)


def plot(rng: np.random.Generator, area: np.ndarray) -> None:
    """Draw a small chart into `area`."""
    height, width = area.shape[:2]
    area[:] = (0.84, 0.87, 0.9)
    for k in range(1, 6):
        area[height * k // 6] = area[:, width * k // 6] = (0.68, 0.72, 0.76)
    for k in range(3):
        curve = np.cumsum(rng.standard_normal(40)) * 0.07 + rng.uniform(0.3, 0.7)
        points = np.stack(
            [np.linspace(0, width, 40), np.clip(curve, 0.05, 0.95) * height], -1
        ).astype(np.int32)
        cv2.polylines(area, [points], False, tuple(PALETTE[(k * 2 + 1) % 6]), 3, cv2.LINE_AA)
    cv2.rectangle(area, (0, 0), (width - 1, height - 1), INK, 2)


def code_screen(rng: np.random.Generator, size: tuple[int, int] = (760, 1300)) -> np.ndarray:
    """A monitor's picture: an editor with coloured code, a file list and a chart."""
    height, width = size
    image = np.full((height, width, 3), (0.09, 0.11, 0.15))
    image[:, :210] = (0.14, 0.165, 0.21)
    image[:40] = (0.22, 0.25, 0.31)
    image[-26:] = (0.12, 0.36, 0.55)
    inks = [
        (0.5, 0.72, 0.93),
        (0.86, 0.62, 0.36),
        (0.62, 0.8, 0.5),
        (0.83, 0.83, 0.85),
        (0.78, 0.5, 0.76),
    ]
    write_text(
        image, "render.py   blend.py   camera.py", (230, 28), height_px=18, colour=(0.85, 0.87, 0.9)
    )
    for row in range(24):
        write_text(
            image,
            phrase(rng, 1),
            (24 + 16 * (row % 3), 72 + row * 27),
            height_px=16,
            colour=inks[3 if row % 4 else 0],
        )
    indent = 0
    for row in range(27):
        write_text(
            image, str(row + 1), (222, 68 + row * 25), height_px=14, colour=(0.4, 0.43, 0.48)
        )
        indent = int(np.clip(indent + rng.integers(-1, 2), 0, 3))
        x = 270.0 + 36 * indent
        for _ in range(int(rng.integers(0, 6))):
            word = str(rng.choice(WORDS)) + str(rng.choice(["", "()", " =", ":", ","]))
            x += (
                write_text(
                    image,
                    word,
                    (x, 68 + row * 25),
                    height_px=17,
                    colour=inks[int(rng.integers(0, 5))],
                )
                + 14
            )
    plot(rng, image[90:380, 850:1270])
    thumbnail = landscape(rng, (260, 420)) / 255.0
    image[420:680, 850:1270] = thumbnail
    return to_uint8(image)


def landscape(rng: np.random.Generator, size: tuple[int, int] = (900, 700)) -> np.ndarray:
    """Sky, clouds, hills and trees: what the window shows."""
    height, width = size
    down = np.linspace(0, 1, height)[:, None, None]
    image = (1 - down) * np.array((0.42, 0.6, 0.82)) + down * np.array((0.82, 0.86, 0.88))
    image = np.repeat(image, width, axis=1)
    cloud = np.clip(fractal(rng, size, height / 4, 6) * 0.5, 0, 1)[..., None]
    image = image * (1 - cloud) + 0.92 * cloud
    x = np.arange(width)
    for k in range(5):
        ridge = (
            height * (0.45 + 0.11 * k)
            + smooth_noise(rng, (2, width), (2, width / (4 + 3 * k)))[0] * height * 0.035
        )
        ridge += smooth_noise(rng, (2, width), (2, 5))[0] * height * 0.006 * (k + 1)
        tone = np.array((0.45, 0.56, 0.6)) * (1 - k / 5) + np.array((0.17, 0.27, 0.12)) * k / 5
        mask = np.arange(height)[:, None] > ridge[x][None]
        image = np.where(mask[..., None], shaded(tone, 1 + 0.2 * fractal(rng, size, 24, 4)), image)
    return to_uint8(image)


def map_poster(rng: np.random.Generator, size: tuple[int, int] = (1000, 720)) -> np.ndarray:
    """A relief map with contour lines, a grid, place names and a title."""
    height, width = size
    relief = fractal(rng, size, 330, 6)
    band = np.floor(relief * 4).astype(int)
    tones = np.array(
        [
            (0.36, 0.56, 0.7),
            (0.5, 0.68, 0.78),
            (0.66, 0.74, 0.52),
            (0.78, 0.76, 0.5),
            (0.76, 0.6, 0.38),
            (0.6, 0.42, 0.3),
        ]
    )
    image = tones[np.clip(band + 2, 0, 5)]
    lines = (np.abs(relief * 10 - np.round(relief * 10)) < 0.07)[..., None]
    image = np.where(lines, image * 0.66, image)
    image[::100] *= 0.7
    image[:, ::100] *= 0.7
    for _ in range(26):
        at = (int(rng.integers(30, width - 160)), int(rng.integers(60, height - 150)))
        cv2.circle(image, at, 5, (0.6, 0.1, 0.1), -1, cv2.LINE_AA)
        write_text(
            image, str(rng.choice(WORDS)).title(), (at[0] + 9, at[1] + 6), height_px=16, colour=INK
        )
    image[-110:] = (0.88, 0.85, 0.76)
    write_text(
        image,
        "ATLAS OF PARALLAX",
        (40, height - 52),
        height_px=42,
        colour=(0.2, 0.24, 0.32),
        bold=True,
    )
    write_text(image, phrase(rng, 7), (42, height - 18), height_px=18, colour=INK)
    return framed(to_uint8(image), 16, (0.88, 0.85, 0.76))


def art_poster(rng: np.random.Generator, size: tuple[int, int] = (1000, 720)) -> np.ndarray:
    """Overlapping quarter rings on coloured squares."""
    height, width = size
    image = np.full((height, width, 3), (0.9, 0.86, 0.77))
    cell = 120
    for top in range(0, height - 160, cell):
        for left in range(0, width, cell):
            colours = PALETTE[rng.permutation(len(PALETTE))[:4]]
            tile = np.ascontiguousarray(np.broadcast_to(colours[0], (cell, cell, 3)))
            corner = (int(rng.integers(0, 2)) * cell, int(rng.integers(0, 2)) * cell)
            for k, radius in enumerate((cell, 84, 48, 18)):
                cv2.circle(tile, corner, radius, tuple(colours[k % 3 + 1]), -1, cv2.LINE_AA)
            image[top : top + cell, left : left + cell] = tile[: height - top, : width - left]
    image *= (1 + 0.04 * smooth_noise(rng, size, (2, 2)))[..., None]
    write_text(image, "FORM & DEPTH", (34, height - 64), height_px=58, colour=INK, bold=True)
    write_text(
        image,
        "an exhibition in seven planes",
        (36, height - 18),
        height_px=26,
        colour=(0.55, 0.2, 0.15),
    )
    return framed(to_uint8(image), 14, (0.93, 0.9, 0.84))


def framed(image: np.ndarray, rim_px: int, colour: tuple[float, ...]) -> np.ndarray:
    """The picture with a paper rim."""
    rgb = [int(c * 255) for c in colour]
    return cv2.copyMakeBorder(image, *(rim_px,) * 4, cv2.BORDER_CONSTANT, value=rgb)


def cork_board(rng: np.random.Generator, size: tuple[int, int] = (800, 1000)) -> np.ndarray:
    """Cork with notes, cards and a page pinned on it."""
    height, width = size
    speckle = smooth_noise(rng, size, (5, 5)) * 0.09 + smooth_noise(rng, size, (2, 2)) * 0.07
    image = shaded((0.66, 0.47, 0.29), 1 + speckle)
    for k in range(14):
        h, w = int(rng.integers(110, 220)), int(rng.integers(110, 190))
        x, y = (
            int(20 + (k % 5) * 192 + rng.integers(0, 30)),
            int(20 + (k // 5) * 255 + rng.integers(0, 40)),
        )
        h, w = min(h, height - y - 10), min(w, width - x - 10)
        if k % 4 == 0:
            note = landscape(rng, (h, w)) / 255.0
        else:
            note = np.full((h, w, 3), PALETTE[[3, 7, 11, 13, 17][k % 5]]) * 0.96
            for line in range(26, h - 8, 20):
                write_text(note, phrase(rng, 3), (9, line), height_px=12, colour=INK)
        image[y + 4 : y + h + 4, x + 4 : x + w + 4] *= 0.6
        image[y : y + h, x : x + w] = note
        cv2.circle(image, (x + w // 2, y + 9), 7, tuple(PALETTE[k % 6]), -1, cv2.LINE_AA)
    return to_uint8(image)


def spine_atlas(
    rng: np.random.Generator, count: int = 40, cell: tuple[int, int] = (512, 96)
) -> np.ndarray:
    """`count` book spines side by side, then one cell of page edges."""
    height, width = cell
    cells = []
    for k in range(count):
        base = PALETTE[rng.integers(0, len(PALETTE))] * rng.uniform(0.75, 1.0)
        spine = shaded(
            base, 1 + 0.05 * smooth_noise(rng, cell, (2, 2)) + 0.04 * fractal(rng, cell, 60)
        )
        ink = (0.93, 0.88, 0.72) if base.mean() < 0.5 else (0.16, 0.14, 0.16)
        accent = PALETTE[rng.integers(0, len(PALETTE))]
        for y in (26, 44, height - 40, height - 90):
            if rng.random() < 0.6:
                cv2.rectangle(
                    spine, (0, y), (width, y + int(rng.integers(3, 16))), tuple(accent), -1
                )
        if rng.random() < 0.35:
            top = int(rng.integers(80, 140))
            cv2.rectangle(
                spine,
                (6, top),
                (width - 7, top + int(rng.integers(120, 250))),
                tuple(accent * 0.85),
                -1,
            )
        lying = np.ascontiguousarray(cv2.rotate(spine, cv2.ROTATE_90_COUNTERCLOCKWISE))
        title = phrase(rng, 2 + k % 2).title()
        letter_px = min(float(rng.uniform(26, 36)), 370 / len(title))
        write_text(
            lying,
            title,
            (100, 48 + 0.4 * letter_px),
            height_px=letter_px,
            colour=ink,
            bold=k % 3 > 0,
        )
        spine = cv2.rotate(lying, cv2.ROTATE_90_CLOCKWISE)
        write_text(
            spine,
            str(rng.choice(["PK", "MP", "LF", "XI", "VII"])),
            (26, height - 58),
            height_px=22,
            colour=ink,
        )
        spine[:, :5] *= 0.7
        spine[:, -5:] *= 0.7
        cells.append(to_uint8(spine))
    edges = shaded((0.88, 0.84, 0.74), 1 + 0.1 * smooth_noise(rng, cell, (300, 1.5)))
    return np.concatenate([*cells, to_uint8(edges)], axis=1)


def book_cover(rng: np.random.Generator, size: tuple[int, int] = (640, 480)) -> np.ndarray:
    """The front of a book."""
    height = size[0]
    image = landscape(rng, size) / 255.0 * np.array((1.0, 0.85, 0.7))
    image[: height // 3] = PALETTE[0] * 0.9
    write_text(image, "Between", (40, 90), height_px=62, colour=(0.95, 0.9, 0.78), bold=True)
    write_text(image, "the Layers", (40, 170), height_px=62, colour=(0.95, 0.9, 0.78), bold=True)
    write_text(image, phrase(rng, 4), (40, height - 30), height_px=26, colour=(0.95, 0.9, 0.78))
    return to_uint8(image * (1 + 0.04 * smooth_noise(rng, size, (2, 2)))[..., None])


def key_atlas() -> np.ndarray:
    """16 x 4 keycaps, 48 px each; the last is the case's plastic."""
    legends = "QWERTYUIOPASDFGHJKLZXCVBNM1234567890-=[];',./<>?!@#$%^&*()+_{}"
    image = np.zeros((4 * 48, 16 * 48, 3))
    for k in range(64):
        x, y = (k % 16) * 48, (k // 16) * 48
        tone = (0.27, 0.29, 0.33) if k % 7 else (0.75, 0.42, 0.2)
        image[y : y + 48, x : x + 48] = np.array(tone) * 0.72
        cv2.rectangle(image, (x + 5, y + 3), (x + 42, y + 38), tone, -1)
        if k < len(legends):
            write_text(image, legends[k], (x + 11, y + 31), height_px=24, colour=(0.92, 0.92, 0.88))
    image[-48:, -48:] = (0.5, 0.5, 0.5)
    return to_uint8(image)
