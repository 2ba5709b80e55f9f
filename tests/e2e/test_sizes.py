"""Whatever the size of the screen, every control is whole, free of the others, and in reach."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext

from e2e.virtual_phone_page import VirtualPhonePage, keep_picture
from live_server import LiveServer

SIZES = {
    "phone": (412, 915),
    "small phone": (360, 640),
    "phone on its side": (844, 390),
    "laptop": (1366, 650),
    "small window": (1000, 600),
    "full HD": (1920, 1080),
    "4K": (3840, 2160),
    "enlarged to 200 %": (640, 400),
}

DESK = Path(__file__).parents[2] / "scenes" / "desk"
PLAYS_THE_DESK = ("demo", str(DESK), "--no-open", "--pixels", "30000")

FAULTS = """() => {
  const shown = Array.from(document.querySelectorAll(
    '#overlay button, #overlay .meter, #overlay .coach, .about, .about a'))
    .filter((each) => each.checkVisibility({ visibilityProperty: true }))
    .map((each) => ({
      each, name: each.ariaLabel ?? each.className, box: each.getBoundingClientRect(),
    }))
    .filter(({ box }) => box.width > 0);
  const faults = shown.filter(({ box }) => box.left < -1 || box.top < -1
    || box.right > innerWidth + 1 || box.bottom > innerHeight + 1)
    .map(({ name }) => `${name} is cut off`);
  for (const a of shown) for (const b of shown) {
    if (a === b || a.each.contains(b.each) || b.each.contains(a.each)) continue;
    const right = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
    const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
    if (right > 1 && down > 1) faults.push(`${a.name} lies over ${b.name}`);
  }
  for (const { each, name, box } of shown) {
    if (!each.matches('button')) continue;
    const there = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    if (there === null || !each.contains(there)) faults.push(`${name} cannot be pressed`);
  }
  return faults;
}"""


@pytest.mark.parametrize("server", [PLAYS_THE_DESK], indirect=True)
def test_controls_are_whole_and_in_reach(context: BrowserContext, server: LiveServer) -> None:
    for source in ("virtual", "replay"):
        page = context.new_page()
        phone = VirtualPhonePage(page, server.address, query=f"source={source}")
        faults: dict[str, list[str]] = {}
        for name, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            phone.let_pass(2)
            faults[name] = page.evaluate(FAULTS)
            keep_picture(page, f"size-{width}x{height}-{source}")
        assert faults == {name: [] for name in SIZES}, source
        assert phone.problems == []
        page.close()
