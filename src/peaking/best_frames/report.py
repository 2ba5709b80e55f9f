"""The report of a selection: one file that needs no network, for people."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence

import numpy as np

from peaking.best_frames import BestFrames, Gap
from peaking.best_frames.choosing import FrameChoice
from peaking.datasets import Recording
from peaking.replay.charts import nice_at_least
from peaking.replay.path_map_svg import map_view, path_map
from peaking.replay.records import FrameRecord
from peaking.reports.page import both_sizes, html_page, jpeg_image, legend, resource
from peaking.selection.policy import CurvePoint

MOST_THUMBNAILS = 48
"""Pictures shown of those kept, and of those left out; of more, some at even steps."""

LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 48, 16, 14, 40


def best_frames_page(recording: Recording, best: BestFrames) -> str:
    """Return the page."""
    left_out = [frame for frame in best.frames if not frame.kept]
    kept = [frame for frame in best.frames if frame.kept]
    body = "".join(
        [
            _header(recording, best),
            _numbers(best),
            _curve_section(best),
            _map_section(recording, best),
            _thumbnails("Kept", kept, best),
            _reasons(left_out, best),
        ]
    )
    style = resource("peaking.best_frames", "report.css")
    return html_page(f"{recording.name}: the best {len(kept)} frames", body, style=style)


def _header(recording: Recording, best: BestFrames) -> str:
    return (
        f'<header><div><p class="kind">Selection</p><h1>{html.escape(recording.name)}</h1>'
        f'<p class="note">The best {len(best.kept)} of {len(best.frames)} frames.</p></div>'
        '<nav><a href="selection.csv">All frames (CSV)</a>'
        '<a href="transforms.json">Data set</a></nav></header>\n'
    )


def _numbers(best: BestFrames) -> str:
    why = Counter(frame.reason for frame in best.frames if not frame.kept)
    here = _at(best.curve, len(best.kept))
    tiles = [("Kept", str(len(best.kept)), f"of {len(best.frames)} frames")]
    if isinstance(here, CurvePoint):
        tiles.append(("Predicted", f"{here.psnr_db:.1f}\u00a0dB", "PSNR of frames by others"))
    elif here is not None:
        tiles.append(("Largest gap", f"{100 * here.gap_share:.0f}\u00a0%", "of the distance"))
    tiles += [
        (str(count), html.escape(reason), "") for reason, count in why.most_common(3) if reason
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{note}</small></dd></div>"
        if note
        else f"<div><dt>left out</dt><dd>{name}<small>{value}</small></dd></div>"
        for name, value, note in tiles
    )
    return f'<dl class="numbers">{cells}</dl>\n'


def _curve_section(best: BestFrames) -> str:
    if best.by_pictures:
        heading = "What more views bring"
        note = (
            "Mean PSNR of all frames, each predicted by kept views other than itself, at a "
            "sixteenth of the pixels."
        )
    else:
        heading = "How far apart the views are"
        note = (
            "Without depth, pictures cannot be predicted: only poses and sharpness are known, "
            "not what a model gets wrong. The curve is the largest distance of a frame from the "
            "nearest kept one, rotations counted, over the distance of things."
        )
    wide, narrow = (_curve(best, size_px) for size_px in ((1080, 300), (350, 240)))
    return (
        f'<section><h2>{heading}</h2><p class="note">{note}</p>{both_sizes(wide, narrow)}'
        "</section>\n"
    )


def _curve(best: BestFrames, size_px: tuple[int, int]) -> str:
    width, height = size_px
    left, right = LEFT_PX, width - RIGHT_PX
    top, bottom = TOP_PX, height - BOTTOM_PX
    numbers = np.array([point.num_views for point in best.curve])
    values = np.array([_value(point) for point in best.curve])
    step = nice_at_least(max(float(np.ptp(values)), 1e-3) / 4)
    low = step * np.floor(values.min() / step)
    high = max(step * np.ceil(values.max() / step), low + step)
    last = max(2, int(numbers.max()))

    def x_px(number: float) -> float:
        return left + (right - left) * (number - 1) / (last - 1)

    def y_px(value: float) -> float:
        return bottom - (bottom - top) * (value - low) / (high - low)

    parts: list[str] = []
    for tick in np.arange(low, high + step / 2, step):
        y = y_px(float(tick))
        parts.append(f'<line class="grid" x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{left - 8}" y="{y + 4:.1f}" class="end">{tick:g}</text>')
    every = round(nice_at_least(max(1.0, last / max(2, width // 110))))
    parts += [
        f'<text x="{x_px(float(number)):.1f}" y="{bottom + 18}" class="mid">{number}</text>'
        for number in [1, *range(every, last + 1, every)]
    ]
    parts.append(f'<text x="{right}" y="{height - 4}" class="end">views</text>')
    points = "L".join(
        f"{x_px(float(n)):.1f} {y_px(float(v)):.1f}" for n, v in zip(numbers, values, strict=True)
    )
    parts.append(f'<path class="curve" d="M{points}"/>')
    here = _at(best.curve, len(best.kept))
    words = f"A curve over 1 to {last} views."
    if here is not None:
        x, y = x_px(float(here.num_views)), y_px(_value(here))
        parts.append(
            f'<line class="chosen-line" x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{bottom}"/>'
            f'<circle class="chosen" r="5" cx="{x:.1f}" cy="{y:.1f}"/>'
        )
        words += f" {here.num_views} are kept: {_value(here):.3g} {_unit(best)}."
    parts.append(f'<text x="{left}" y="{height - 4}">{_unit(best)}</text>')
    return (
        f'<svg class="views-curve" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(words)}">{"".join(parts)}</svg>'
    )


def _unit(best: BestFrames) -> str:
    return "dB" if best.by_pictures else "% of the distance"


def _value(point: CurvePoint | Gap) -> float:
    return point.psnr_db if isinstance(point, CurvePoint) else 100 * point.gap_share


def _at(curve: Sequence[CurvePoint] | Sequence[Gap], number: int) -> CurvePoint | Gap | None:
    return next((point for point in curve if point.num_views == number), None)


def _map_section(recording: Recording, best: BestFrames) -> str:
    records: list[FrameRecord] = []
    for frame, camera in zip(best.frames, recording.cameras, strict=True):
        rotation = camera.world_from_cam.rotation
        records.append(
            FrameRecord(
                index=frame.number,
                name=frame.name,
                position_m=camera.position_m,
                forward=rotation[:, 2],
                up=-rotation[:, 1],
                captured=frame.kept,
                reason=frame.reason,
            )
        )
    view = map_view(records)
    wide, narrow = path_map(records, view, (1080, 430)), path_map(records, view, (350, 320))
    entries = [
        ('<path class="path" d="M0 11L9 4L17 9L26 3"/>', "camera"),
        (
            '<g class="view"><path d="M13 13L7 2H19Z"/><circle r="2" cx="13" cy="13"/></g>',
            "kept, looking to its open side",
        ),
    ]
    return (
        f'<section><h2>Path of the camera</h2><p class="note">{view.words.capitalize()}; '
        f"both axes to the same scale.</p>{both_sizes(wide, narrow)}{legend(entries)}</section>\n"
    )


def _reasons(left_out: Sequence[FrameChoice], best: BestFrames) -> str:
    by_reason: dict[str, list[FrameChoice]] = {}
    for frame in left_out:
        by_reason.setdefault(frame.reason, []).append(frame)
    return "".join(
        _thumbnails(f"Left out: {reason}", frames, best)
        for reason, frames in sorted(by_reason.items(), key=lambda item: len(item[1]))
    )


def _thumbnails(heading: str, frames: Sequence[FrameChoice], best: BestFrames) -> str:
    if not frames:
        return ""
    places = np.linspace(0, len(frames) - 1, min(MOST_THUMBNAILS, len(frames))).round()
    shown = [frames[int(place)] for place in places]
    figures = "".join(_figure(frame, best) for frame in shown)
    some = "" if len(shown) == len(frames) else f" Of {len(frames)}, {len(shown)} are shown."
    return (
        f'<section><h2>{html.escape(heading)} ({len(frames)})</h2><p class="note">Sharpness is '
        f'relative to frames from nearby.{some}</p><div class="thumbs">{figures}</div></section>\n'
    )


def _figure(frame: FrameChoice, best: BestFrames) -> str:
    picture = best.thumbnails.get(frame.number)
    image = "" if picture is None else jpeg_image(picture, frame.name)
    notes = [frame.reason] if frame.kept else []
    if frame.sharpness is not None:
        notes.append(f"sharpness {frame.sharpness:.2f}")
    if frame.worth_db is not None:
        notes.append(f"worth {frame.worth_db:.2f}\u00a0dB")
    spans = "".join(f"<span>{html.escape(note)}</span>" for note in notes)
    return (
        f"<figure>{image}<figcaption><b>{html.escape(frame.name)}</b>{spans}</figcaption></figure>"
    )
