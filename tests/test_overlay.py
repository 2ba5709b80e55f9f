"""The three marks, each on a picture of its own."""

from __future__ import annotations

import numpy as np
import pytest

from peaking.error_map import ErrorMap
from peaking.overlay import DOT_EVERY_PX, UNFIXABLE_RGB, peaks_on_video

SIZE = (48, 64)


def marked(name: str, live: np.ndarray) -> np.ndarray:
    """A picture of which columns 16 to 48 are wrong, unseen or unfixable, as it is shown."""
    masks = {each: np.zeros(SIZE, bool) for each in ("peaked", "unseen", "unfixable")}
    masks["unfixable" if name == "unfixable" else "peaked"][:, 16:48] = True
    if name == "unseen":
        masks["unseen"][:, 16:48] = True
    return peaks_on_video(ErrorMap(np.zeros(SIZE, np.float32), **masks), live, marks="apart")


def grey(value: int) -> np.ndarray:
    return np.full((*SIZE, 3), value, np.uint8)


@pytest.mark.parametrize("value", [0, 90, 180, 255])
def test_no_mark_is_solid_and_none_reaches_farther_than_its_border(value: int) -> None:
    for name in ("wrong", "unseen", "unfixable"):
        shown = marked(name, grey(value)).astype(int)
        assert (shown[:, :15] == value).all()
        assert (shown[:, 49:] == value).all()
        other = marked(name, grey(255 - value)).astype(int)
        away = np.abs(shown - other)[:, 20:44].sum(axis=-1)
        assert (away > 0.2 * abs(255 - 2 * value)).mean() > 0.5  # one sees what is under it


@pytest.mark.parametrize("value", [0, 90, 180, 255])
def test_dots_are_seen_on_what_is_dark_and_on_what_is_white(value: int) -> None:
    shown = marked("unfixable", grey(value)).astype(int)[:, 20:44]
    amber = (np.abs(shown - UNFIXABLE_RGB).sum(axis=-1) < 60).mean()
    assert 4 / DOT_EVERY_PX**2 <= amber < 12 / DOT_EVERY_PX**2
    luminance = shown @ [0.2126, 0.7152, 0.0722]
    assert luminance.max() - luminance.min() > 60


def test_red_has_a_contour_on_red_things() -> None:
    live = np.zeros((*SIZE, 3), np.uint8)
    live[..., 0] = 230
    shown = marked("wrong", live).astype(int)
    inside, outside = shown[20, 32], shown[20, 5]
    assert np.abs(inside - outside).sum() < 60  # by colour alone, nothing
    assert any(shown[20, x, 1] > outside[1] + 80 for x in range(13, 18))
    assert any(shown[20, x, 1] > outside[1] + 80 for x in range(46, 50))
