"""From asking for a page to its first picture: a light field of 40 views, and Gaussians."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from peaking.benchmarks import view_peers
from peaking.benchmarks.browser import PATIENCE_MS, until
from peaking.benchmarks.servers import command_server
from peaking.benchmarks.view_material import Material, Told, served
from peaking.errors import ToolMissing

ROUNDS = 5
SIZE_PX = {"width": 800, "height": 720}

_WATCH = """(() => {
  const watch = () => {
    const asked_ms = window.viewer?.inspection.firstPicture_ms ?? null;
    if (asked_ms === null) { requestAnimationFrame(watch); return; }
    const gl = document.querySelector('.viewer canvas').getContext('webgl2');
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // until it is drawn
    window.firstPicture = { asked_ms, drawn_ms: performance.now() };
  };
  requestAnimationFrame(watch);
})()"""
_FETCHED = """until_ms => {
  const came = performance.getEntriesByType('resource').filter(e => e.responseEnd <= until_ms);
  const pages = performance.getEntriesByType('navigation');
  return {
    mpis: came.filter(({ name }) => name.endsWith('.mpi')).length,
    bytes: [...pages, ...came].reduce((sum, e) => sum + e.encodedBodySize, 0),
  };
}"""
_SETTLED = """() => {
  const { inspection } = window.viewer;
  return inspection.asleep && inspection.lightField()?.settled === true;
}"""
_PEER_DRAWN = """Object.defineProperty(window, 'captureFrame', {
  set: () => { window.firstPicture_ms ??= performance.now(); },  // it does so after its first frame
});"""


def first_pictures(browser: Any, material: Material, told: Told) -> dict[str, object]:
    """Open each page several times, in turn, each time in a browser that knows nothing of it."""
    folder, page = material.light_field
    splat_page = material.splat_page
    peers: dict[str, object] = {}
    opened: dict[str, Callable[[], dict[str, float]]] = {}
    told("building the viewer of splat-transform")
    try:
        peer = view_peers.splat_transform_page(material.folder, material.gaussians)
        opened["splat_transform_from_disk"] = lambda: _peer(browser, peer)
        peers["splat-transform"] = view_peers.SPLAT_TRANSFORM
    except ToolMissing as error:
        peers["splat-transform"] = f"not installed: {error}"
    viewed = ["view", str(material.scene)]
    with served(folder) as address, command_server(viewed) as view_address:
        told("peaking view: the first browser of all")
        first = _light_field(browser, view_address)
        opened |= {
            "folder": lambda: _light_field(browser, f"{address}/index.html"),
            "single_file": lambda: _light_field(browser, page.as_uri()),
            "peaking_view": lambda: _light_field(browser, view_address),
            "splat_from_disk": lambda: _splat(browser, splat_page.as_uri()),
        }
        rounds: dict[str, list[dict[str, float]]] = {name: [] for name in opened}
        for number in range(ROUNDS):
            for name, measure in opened.items():
                told(f"first picture, {name}: {number + 1} of {ROUNDS}")
                rounds[name].append(measure())
    return {
        "peaking_view_first_browser": medians([first]),
        **{name: medians(measured) for name, measured in rounds.items()},
        "rounds": ROUNDS,
        "megabytes_from_disk": {
            "light_field": _megabytes(page),
            "splat": _megabytes(splat_page),
        },
        "peers": peers,
    }


def medians(rounds: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the median of each figure, and the longest time to the first picture."""
    if not rounds:
        raise ValueError("need at least one round")
    found = {name: round(float(np.median([one[name] for one in rounds])), 3) for name in rounds[0]}
    longest = max(one["first_picture_s"] for one in rounds)
    return {**found, "first_picture_longest_s": round(longest, 3)}


def _light_field(browser: Any, address: str) -> dict[str, float]:
    page = _page(browser, _WATCH)
    page.goto(address, wait_until="commit")
    until(page, "() => window.firstPicture !== undefined")
    first = page.evaluate("window.firstPicture")
    until(page, _SETTLED)
    settled_ms = page.evaluate("performance.now()")
    by_then = page.evaluate(_FETCHED, first["drawn_ms"])
    in_all = page.evaluate(_FETCHED, sys.float_info.max)
    page.context.close()
    return {
        "first_picture_s": first["drawn_ms"] / 1e3,
        "asked_for_s": first["asked_ms"] / 1e3,
        "settled_s": settled_ms / 1e3,
        "mpis_by_then": by_then["mpis"],
        "megabytes_by_then": by_then["bytes"] / 1e6,
        "mpis_when_settled": in_all["mpis"],
        "megabytes_when_settled": in_all["bytes"] / 1e6,
    }


def _splat(browser: Any, address: str) -> dict[str, float]:
    page = _page(browser, "0")
    page.goto(address, wait_until="commit")
    until(page, "() => (window.viewer?.inspection.count() ?? 0) > 0 && viewer.inspection.asleep")
    drawn_ms = page.evaluate("performance.now()")
    page.context.close()
    return {"first_picture_s": drawn_ms / 1e3}


def _peer(browser: Any, path: Path) -> dict[str, float]:
    page = _page(browser, _PEER_DRAWN)
    page.goto(path.as_uri(), wait_until="commit")
    until(page, "() => window.firstPicture_ms !== undefined")
    drawn_ms = page.evaluate("window.firstPicture_ms")
    page.context.close()
    return {"first_picture_s": drawn_ms / 1e3}


def _page(browser: Any, script: str) -> Any:
    """Return a page of a browser that knows nothing, in which a script runs first."""
    page = browser.new_context(viewport=SIZE_PX).new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.add_init_script(script)
    return page


def _megabytes(path: Path) -> float:
    return round(path.stat().st_size / 1e6, 2)
