"""A phone whose processor is throttled: the rendering gives way, the shutter does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from playwright.sync_api import BrowserContext

from e2e.virtual_phone_page import VirtualPhonePage, moved
from live_server import LiveServer

TINY = ("demo", "--no-open", "--pixels", "8000")
"""So small that a frame takes the processor's time and not that of the drawing, which a graphics
card would do."""

THROTTLES = (4, 8, 16)
"""Times. Fourfold is enough on a machine whose load stays as it is; more where others take part."""

CALM = 3.0
"""A page is slow when its frames take so many times as long as they took."""

SECONDS = 240.0
"""Levels are waited for so long, because other programs may need the machine."""


def pace(phone: VirtualPhonePage) -> dict[str, Any]:
    """Return how much is drawn; what has no limit is null."""
    return phone.page.evaluate("window.peaking.pace()")


def frame_ms(phone: VirtualPhonePage) -> float:
    """Return the median time from frame to frame, over some spans."""
    took_ms = []
    for _ in range(5):
        before, begin_ms = phone.page.evaluate("[window.peaking.frames(), performance.now()]")
        phone.let_pass(15)
        after, end_ms = phone.page.evaluate("[window.peaking.frames(), performance.now()]")
        took_ms.append((end_ms - begin_ms) / (after - before))
    return float(np.median(took_ms))


@pytest.mark.parametrize("server", [TINY], indirect=True)
def test_the_rendering_gives_way_and_comes_back_and_the_shutter_answers(
    context: BrowserContext, server: LiveServer
) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address)
    assert pace(phone)["level"] is None
    phone.hold(moved())
    phone.shoot_and_wait()
    slow_ms = CALM * frame_ms(phone)
    phone = VirtualPhonePage(page, server.address, governor=f"{slow_ms:.0f}")
    phone.until("() => window.peaking.seen()?.viewIds.length === 1")
    phone.wait_for(lambda: pace(phone)["level"] == 0, seconds=SECONDS)
    whole = pace(phone)["pixels"]

    def rises(throttle: int) -> bool:
        devtools.send("Emulation.setCPUThrottlingRate", {"rate": throttle})
        last = throttle == THROTTLES[-1]
        try:
            phone.wait_for(
                lambda: pace(phone)["level"] >= 1, seconds=SECONDS if last else SECONDS / 8
            )
        except AssertionError:
            if last:
                raise
            return False
        return True

    devtools = context.new_cdp_session(page)
    assert any(rises(throttle) for throttle in THROTTLES)
    phone.wait_for(lambda: pace(phone)["pixels"] < whole, seconds=SECONDS)
    aligned = page.evaluate("window.peaking.tracking().succeeded")
    phone.hold(moved(x_m=0.1))
    second = phone.shoot()
    phone.wait_for(lambda: phone.states() == ["ready"] * 2, seconds=SECONDS)
    assert [view["id"] for view in phone.views()][1] == second
    phone.wait_for(
        lambda: page.evaluate("window.peaking.tracking().succeeded") > aligned, seconds=SECONDS
    )
    phone.keep_picture("governor-throttled")

    devtools.send("Emulation.setCPUThrottlingRate", {"rate": 1})
    phone.wait_for(lambda: pace(phone)["level"] == 0, seconds=SECONDS)
    phone.wait_for(lambda: pace(phone)["pixels"] == whole, seconds=SECONDS)
    phone.keep_picture("governor-back")
    assert phone.problems == []
