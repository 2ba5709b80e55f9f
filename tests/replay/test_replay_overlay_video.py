import numpy as np
import pytest
from replay_factories import FRAMES, THRESHOLD_SHARE, panels, path_record, walk

from peaking.replay.overlay_video import (
    BACKGROUND,
    CAPTION_PX,
    GAP_PX,
    MARGIN_PX,
    MAX_WIDTH_PX,
    PEAK,
    SHUTTER,
    TEXT,
    OverlayVideo,
    draw_text,
    text_width_px,
)


def overlay(size_px: tuple[int, int], frames: int = FRAMES) -> OverlayVideo:
    return OverlayVideo(size_px, frames=frames, threshold_share=THRESHOLD_SHARE)


def has_color(picture: np.ndarray, color: tuple[int, int, int]) -> bool:
    return bool((picture == color).all(axis=-1).any())


def test_the_panels_stand_side_by_side_untouched() -> None:
    shown = panels((294, 639))
    picture = overlay((294, 639)).draw(shown, path_record(5))
    for place, panel in enumerate((shown.live, shown.rendering, shown.peaks)):
        left = MARGIN_PX + place * (294 + GAP_PX)
        np.testing.assert_array_equal(
            picture[CAPTION_PX : CAPTION_PX + 639, left : left + 294], panel
        )


@pytest.mark.parametrize("size_px", [(294, 639), (500, 375), (33, 21), (1, 1), (1080, 1920)])
def test_the_picture_has_an_even_size_that_plays(size_px: tuple[int, int]) -> None:
    drawn = overlay(size_px)
    width, height = drawn.size_px
    assert width % 2 == height % 2 == 0
    assert width <= MAX_WIDTH_PX
    picture = drawn.draw(panels(size_px), path_record(1))
    assert picture.shape == (height, width, 3)
    assert picture.dtype == np.uint8


def test_a_capture_is_marked_in_its_own_frame_alone() -> None:
    drawn = overlay((294, 639))
    corner = (slice(CAPTION_PX - 3, CAPTION_PX), slice(MARGIN_PX, MARGIN_PX + 294))
    shown = panels((294, 639))
    marked = [
        has_color(drawn.draw(shown, record)[corner], SHUTTER)
        for record in (path_record(i, captured=i == 10) for i in range(9, 13))
    ]
    assert marked == [False, True, False, False]


def test_the_share_is_red_only_above_the_threshold() -> None:
    drawn = overlay((294, 639))
    caption = (slice(0, CAPTION_PX - 3), slice(MARGIN_PX + 2 * (294 + GAP_PX), None))
    low = drawn.draw(panels((294, 639)), path_record(1, peaked_share=0.0428)).copy()
    high = drawn.draw(panels((294, 639)), path_record(2, peaked_share=0.0429))
    assert has_color(low[caption], TEXT)
    assert not has_color(low[caption], PEAK)
    assert has_color(high[caption], PEAK)


def test_the_strip_grows_to_the_right_and_keeps_its_past() -> None:
    drawn = overlay((60, 40))
    shown = panels((60, 40))
    before = drawn._strip
    for record in walk():
        drawn.draw(shown, record)
        if record.index == 70:
            before = drawn._strip.copy()
    middle = drawn._x_px(70)
    np.testing.assert_array_equal(drawn._strip[:, : middle - 6], before[:, : middle - 6])
    assert not np.array_equal(drawn._strip[:, middle + 6 :], before[:, middle + 6 :])


def test_a_share_beyond_the_strip_and_an_index_beyond_the_end_are_drawn_at_the_edge() -> None:
    drawn = overlay((60, 40), frames=3)
    drawn.draw(panels((60, 40)), path_record(1, peaked_share=1.0))
    drawn.draw(panels((60, 40)), path_record(7, peaked_share=1.0))


def test_one_frame_is_a_replay_too() -> None:
    overlay((60, 40), frames=1).draw(panels((60, 40)), path_record(0))
    with pytest.raises(ValueError, match="at least 1 frame"):
        overlay((60, 40), frames=0)


def test_a_panel_that_does_not_fit_is_refused() -> None:
    for size_px in ((61, 40), (60, 41)):
        with pytest.raises(ValueError, match=r"need panels of \(60, 40\), got 6"):
            overlay((60, 40)).draw(panels(size_px), path_record(0))


def test_a_smaller_panel_stands_in_the_middle() -> None:
    """A phone that was turned in between: portrait and landscape in one video."""
    drawn = overlay((300, 300))
    for width, height in ((300, 200), (200, 300)):
        shown = panels((width, height))
        picture = drawn.draw(shown, path_record(5))
        for place, panel in enumerate((shown.live, shown.rendering, shown.peaks)):
            left, top = MARGIN_PX + place * (300 + GAP_PX), CAPTION_PX
            whole = picture[top : top + 300, left : left + 300]
            beside, below = (300 - width) // 2, (300 - height) // 2
            inner = whole[below : below + height, beside : beside + width]
            np.testing.assert_array_equal(inner, panel)
            inner[:] = BACKGROUND
            assert (whole == BACKGROUND).all()


def test_text_is_cut_off_at_the_edge_and_has_a_width() -> None:
    picture = np.full((20, 30, 3), BACKGROUND, dtype=np.uint8)
    after = draw_text(picture, "rendering", (10, 10), color=TEXT)
    assert after == 10 + text_width_px("rendering") > 30
    draw_text(picture, "rendering", (40, 50), color=TEXT)
    assert has_color(picture, BACKGROUND)
    assert not (picture == BACKGROUND).all()
