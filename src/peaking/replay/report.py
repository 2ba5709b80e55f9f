"""Writes report.html: one file that needs no network, for people."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from peaking.replay.charts import MAX_POINTS, percent, share_chart
from peaking.replay.path_map_svg import MapView, map_view, path_map
from peaking.replay.records import FrameRecord, ReplayHeader, ReplaySummary, write_text
from peaking.replay.stills import Still, encode_stills
from peaking.reports.page import both_sizes, html_page, jpeg_image, legend, options_table, resource

PAGE_BYTES = 2_900_000
"""The page stays below this; the stills take what the rest leaves, and shrink if they must."""

KINDS = {"worst": "Worst frames", "typical": "Typical frames (near the median)"}


def write_report(
    path: Path,
    *,
    summary: ReplaySummary,
    records: Sequence[FrameRecord],
    stills: Sequence[Still],
) -> None:
    """Write the report.

    It links to the overlay video, the captured data set, the table and the summary where they lie
    beside it at that time, so it is written last.

    Args:
        path: The file, report.html by custom.
        summary: The replay in a few numbers.
        records: Its frames, in order.
        stills: Pictures to show, see `StillPicker`.

    Raises:
        OSError: The file cannot be written.
        ValueError: There is no frame.
    """
    if not records:
        raise ValueError("need at least 1 frame to report on")
    settings = summary.settings
    view = map_view(records)
    style, script = (resource("peaking.replay", name) for name in ("report.css", "report.js"))
    sections = [
        _header(path.parent, summary),
        _numbers(summary),
        _share_section(records, summary),
        f'<div class="two">{_map_section(records, view)}{_stages(summary)}</div>',
        _video(path.parent, summary.settings),
        _options(summary),
    ]
    frames = _frames_json(records, view)
    rest = len(frames) + sum(len(section) for section in sections)
    sections.insert(-1, _stills_section(records, stills, most_bytes=PAGE_BYTES - rest))
    sections.append(f"<footer>Made by peaking {html.escape(settings.version)}.</footer>\n")
    below = (
        '<div id="tip"></div>\n'
        f'<script type="application/json" id="frames">{frames}</script>\n'
        f"<script>\n{script}</script>\n"
    )
    page = html_page(
        f"{settings.scene}: peaking replay", "".join(sections), style=style, below=below
    )
    write_text(path, page)


def _header(folder: Path, summary: ReplaySummary) -> str:
    settings = summary.settings
    width, height = settings.size_px
    links = [
        ("overlay.mp4", "Overlay video"),
        ("captured/", "Captured data set"),
        ("frames.csv", "Frames (CSV)"),
        ("summary.json", "Summary (JSON)"),
    ]
    nav = "".join(
        f'<a href="{name}">{words}</a>' for name, words in links if (folder / name).exists()
    )
    return (
        f'<header><div><p class="kind">Replay</p><h1>{html.escape(settings.scene)}</h1>'
        f'<p class="note">{width} × {height} pixels compared, {settings.fps:g} frames per second'
        f"</p></div><nav>{nav}</nav></header>\n"
    )


def _numbers(summary: ReplaySummary) -> str:
    settings = summary.settings
    part = percent(summary.captured / summary.frames) if summary.frames else "–"
    tiles = [
        ("Frames", str(summary.frames), "in the recording"),
        ("Captured", str(summary.captured), f"{part} of the frames"),
        ("Mean peaked share", percent(summary.mean_peaked_share), "of the picture"),
        _what_decided(settings),
        ("Preset", html.escape(settings.preset), f"peaking {html.escape(settings.version)}"),
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{note}</small></dd></div>"
        for name, value, note in tiles
    )
    return f'<dl class="numbers">{cells}</dl>\n'


def _what_decided(settings: ReplayHeader) -> tuple[str, str, str]:
    guide = settings.guide
    if guide is None and settings.policy != "threshold":
        spacing_m = settings.options.get("spacing_m")
        asked = "all frames" if settings.num_views is None else f"{settings.num_views} views"
        if settings.policy == "peaking" and settings.num_views is None:
            asked = "as many views as are enough"
        if isinstance(spacing_m, float) and settings.num_views is None:
            asked = f"a view every {100 * spacing_m:.1f} cm"
        return "Policy", html.escape(settings.policy), f"asked for: {asked}"
    if guide is None:
        return "Threshold", percent(settings.threshold_share), "more than this: captured"
    reached = f"{guide['reached']} / {guide['targets']}"
    return "Targets", reached, f"reached, of the guide “{html.escape(str(guide['kind']))}”"


MARKED = {
    "paper": "in red the pixels where the two differ",
    "apart": "what is marked: red is wrong, a hatch on grey was never seen, amber dots are wrong "
    "and no view will help",
}
"""What the third picture of the video and of the stills shows, by `marks`."""


def _video(folder: Path, settings: ReplayHeader) -> str:
    if not (folder / "overlay.mp4").exists():
        return ""
    marked = MARKED[str(settings.options.get("marks", "paper"))]
    return (
        "<section><h2>Overlay video</h2>"
        '<p class="note">The recording, what can be rendered from the views captured until then, '
        f"and {marked}.</p>"
        '<video controls muted playsinline preload="metadata" src="overlay.mp4" '
        'aria-label="Side by side: live picture, rendering, peaks"></video></section>\n'
    )


def _share_section(records: Sequence[FrameRecord], summary: ReplaySummary) -> str:
    threshold_share = summary.settings.threshold_share
    decides = summary.settings.policy == "threshold" and summary.settings.guide is None
    whose = "the" if decides else "the paper's"
    wide = share_chart(records, (1080, 300), threshold_share=threshold_share)
    narrow = share_chart(records, (350, 240), threshold_share=threshold_share)
    entries = [
        ('<path class="curve" d="M0 10L9 4L17 9L26 3"/>', "peaked share"),
        (
            '<line class="threshold" x1="0" x2="26" y1="7" y2="7"/>',
            f"{whose} threshold {percent(threshold_share)}",
        ),
        ('<g class="shutter"><path d="M8 2h10l-5 9z"/></g>', "captured"),
    ]
    if any(r.unseen_share is not None for r in records):
        entries.append(('<path class="unseen" d="M0 7H26"/>', "never seen (in no captured view)"))
    return (
        "<section><h2>Peaked share over the frames</h2>"
        '<p class="note">Part of the picture that a view from there mends, before a capture: what '
        "is shown wrongly (red), and what no view has seen (hatched). Until the first view is "
        "captured there is nothing to compare with.</p>"
        f"{both_sizes(wide, narrow)}{legend(entries)}</section>\n"
    )


def _map_section(records: Sequence[FrameRecord], view: MapView) -> str:
    wide, narrow = path_map(records, view, (640, 430)), path_map(records, view, (350, 320))
    entries = [
        ('<path class="path" d="M0 11L9 4L17 9L26 3"/>', "camera"),
        (
            '<g class="view"><path d="M13 13L7 2H19Z"/><circle r="2" cx="13" cy="13"/></g>',
            "captured view, looking to its open side",
        ),
    ]
    return (
        f'<section><h2>Path of the camera</h2><p class="note">{view.words.capitalize()}; '
        f"both axes to the same scale.</p>{both_sizes(wide, narrow)}{legend(entries)}</section>"
    )


def _stages(summary: ReplaySummary) -> str:
    longest = max(summary.stage_ms.values(), default=0.0)
    rows = "".join(
        f'<tr><td>{html.escape(stage)}</td><td class="ms">{ms:.1f}</td><td class="bar">'
        f'<i style="width:{100 * ms / max(longest, 1e-9):.0f}%"></i></td></tr>'
        for stage, ms in summary.stage_ms.items()
    )
    return (
        '<section><h2>Time per stage</h2><p class="note">Median over the frames that went '
        'through it.</p><table><thead><tr><th scope="col">stage</th>'
        '<th scope="col" class="ms">ms</th><th class="bar" aria-hidden="true"></th></tr></thead>'
        f"<tbody>{rows}</tbody></table></section>"
    )


def _stills_section(
    records: Sequence[FrameRecord], stills: Sequence[Still], *, most_bytes: int
) -> str:
    if not stills:
        return ""
    by_index = {r.index: r for r in records}
    # Three bytes are four characters in base64.
    encoded = encode_stills(list(stills), most_bytes=3 * most_bytes // 4)
    height, width = stills[0].live.shape[:2]
    shape = "upright" if height > width else "lying"
    parts: list[str] = []
    for kind, heading in KINDS.items():
        figures = [
            _figure(still, by_index.get(still.index), jpegs)
            for still, jpegs in zip(stills, encoded, strict=True)
            if still.kind == kind
        ]
        if figures:
            parts.append(f"<h3>{heading}</h3>{''.join(figures)}")
    return f'<section><h2>Stills</h2><div class="stills {shape}">{"".join(parts)}</div></section>\n'


def _figure(still: Still, record: FrameRecord | None, jpegs: tuple[bytes, bytes, bytes]) -> str:
    share = percent(record.peaked_share if record else None)
    notes = [html.escape(record.name)] if record else []
    if record and record.captured:
        notes.append("▼ captured")
    if record and record.nearest_distance_m is not None:
        notes.append(f"{100 * record.nearest_distance_m:.1f}\u00a0cm from the nearest view")
    if record:
        notes += [
            f"{percent(part)} {word}"
            for part, word in (
                (record.wrong_share, "wrong"),
                (record.unseen_share, "never seen"),
                (record.unfixable_share, "no view will help"),
            )
            if part is not None
        ]
    captions = {
        "live": f"Live picture of frame {still.index}",
        "rendering": f"Frame {still.index} rendered from the captured views",
        "peaks": f"Frame {still.index} with its marks, {share} peaked",
    }
    images = "".join(
        f"<div>{jpeg_image(jpeg, alt)}<p>{name}{f' {share}' if name == 'peaks' else ''}</p></div>"
        for (name, alt), jpeg in zip(captions.items(), jpegs, strict=True)
    )
    return (
        f"<figure><figcaption><b>Frame {still.index}</b><b>{share} peaked</b>"
        f'<span>{" · ".join(notes)}</span></figcaption><div class="three">{images}</div></figure>'
    )


def _options(summary: ReplaySummary) -> str:
    return (
        f"<section><details><summary>Options of the preset “{html.escape(summary.settings.preset)}”"
        f" as used</summary>{options_table(_all_options(summary.settings))}</details></section>\n"
    )


def _all_options(settings: ReplayHeader) -> dict[str, object]:
    return {**settings.options, **({} if settings.guide is None else {"guide": settings.guide})}


def _frames_json(records: Sequence[FrameRecord], view: MapView) -> str:
    """Return what the script shows about frames, every `step`-th of long recordings."""
    points_m = view.point_m(np.array([r.position_m for r in records], dtype=np.float64))
    step = math.ceil(len(records) / MAX_POINTS)
    frames = [
        {
            "index": r.index,
            "name": r.name,
            "share": None if r.peaked_share is None else round(100 * r.peaked_share, 3),
            "captured": r.captured,
            "x": round(float(x), 4),
            "y": round(float(y), 4),
        }
        for r, (x, y) in list(zip(records, points_m, strict=True))[::step]
    ]
    text = json.dumps({"step": step, "frames": frames}, separators=(",", ":"))
    # The only sequences that end or change a script element begin with "<".
    return text.replace("<", "\\u003c")
