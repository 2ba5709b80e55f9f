"""Writes report.html of an evaluation: one file that needs no network, for people."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from peaking.experiments.curves import (
    CURVE_METRICS,
    curve_points,
    interval_chart,
    quality_chart,
    signed,
    verdict,
)
from peaking.experiments.results import MEASURES, Case, CaseResult, Difference, ViewScore
from peaking.experiments.tables import (
    READING,
    Evaluation,
    Table,
    absolute_texts,
    column_heads,
    heading,
    ratio_texts,
    row_name,
    strategies_of,
    table_1,
)
from peaking.experiments.verdicts import sentence
from peaking.output import encode_jpeg, write_atomically
from peaking.reports.page import both_sizes, html_page, jpeg_image, options_table, resource

PAGE_BYTES = 6_000_000
"""The page stays below about this; the pictures take what is left, and shrink if they must."""

WORST_OF_REFERENCE, WORST_OF_OTHERS = 2, 1
"""Pictures per scene and reconstruction, of the reference and of every other strategy."""

PICTURE_STEPS = ((1600, 85), (1280, 78), (960, 72), (720, 65), (540, 55))
"""Width in pixels and JPEG quality, tried in this order where the files as they are do not fit."""

INTERVAL_METRICS = {"psnr": "Mean PSNR", "psnr_p5": "PSNR of the worst views (5th percentile)"}


@dataclass(frozen=True)
class _Part:
    """One scene, reconstruction and choice of test views."""

    scene: str
    reconstruct: str
    test_views: str
    results: list[CaseResult]
    differences: list[Difference]

    @property
    def words(self) -> str:
        return f"{self.reconstruct.upper()}, {self.test_views} test views"


@dataclass(frozen=True)
class _WorstView:
    case: Case
    score: ViewScore
    jpeg: bytes


def write_report(path: Path, evaluation: Evaluation, *, out_root: Path) -> None:
    """Write the report, in one step.

    Args:
        path: The file, report.html by custom.
        evaluation: What it is about.
        out_root: The folder that the pictures of the worst views are relative to.

    Raises:
        OSError: A picture of a worst view cannot be read.
        OutputError: The file cannot be written.
        ValueError: There is no result, or a picture is no JPEG.
    """
    if not evaluation.results:
        raise ValueError("need at least 1 result to report on")
    parts = _parts(evaluation)
    scenes = list(dict.fromkeys(part.scene for part in parts))
    sections = [
        _header(evaluation, scenes),
        *(_verdict_section([p for p in parts if p.scene == scene]) for scene in scenes),
        _table_section(evaluation),
        *(_curves_section(evaluation, [p for p in parts if p.scene == s]) for s in scenes),
        _configuration(evaluation),
    ]
    rest = sum(len(section.encode()) for section in sections) + 50_000  # style and frame
    sections.insert(-1, _worst_section(evaluation, parts, out_root, most_bytes=PAGE_BYTES - rest))
    page = html_page(
        f"{', '.join(scenes)}: peaking evaluation",
        "".join(sections),
        style=resource("peaking.experiments", "evaluation.css"),
    )
    write_atomically(path, page.encode("utf-8", errors="replace"))


def _parts(evaluation: Evaluation) -> list[_Part]:
    """Return the parts, scene by scene, the fair test views first."""
    keys = {(r.case.scene, r.case.test_views, r.case.reconstruct) for r in evaluation.results}
    place = {strategy: k for k, strategy in enumerate(strategies_of(evaluation))}
    differences = sorted(evaluation.comparisons, key=lambda d: (place[d.b], d.n_views))
    ordered = sorted(keys, key=lambda key: (key[0], key[1], key[2] != "mpi", key[2]))
    return [
        _Part(
            scene,
            reconstruct,
            test_views,
            [
                r
                for r in evaluation.results
                if (r.case.scene, r.case.test_views, r.case.reconstruct)
                == (scene, test_views, reconstruct)
            ],
            [
                d
                for d in differences
                if (d.scene, d.test_views, d.reconstruct) == (scene, test_views, reconstruct)
            ],
        )
        for scene, test_views, reconstruct in ordered
    ]


def _fair_first(parts: Sequence[_Part]) -> tuple[list[_Part], list[_Part]]:
    """Return the parts with the first choice of test views (`holdout` if there is one); others."""
    fair = min(part.test_views for part in parts)
    return [p for p in parts if p.test_views == fair], [p for p in parts if p.test_views != fair]


def _header(evaluation: Evaluation, scenes: Sequence[str]) -> str:
    others = len(strategies_of(evaluation)) - 1
    notes = "".join(f'<p class="note">{html.escape(note)}</p>' for note in evaluation.notes)
    return (
        f'<header><div><p class="kind">Evaluation</p><h1>{html.escape(", ".join(scenes))}</h1>'
        f'<p class="note">Do views chosen by <b>{html.escape(evaluation.reference)}</b> give '
        f"better pictures than those of {others} other ways to choose? A dot right of the line "
        "says yes; a grey bar, across the line, says that it may be chance (95 % intervals over "
        f"the test views).</p>{notes}</div></header>\n"
    )


def _verdict_section(parts: Sequence[_Part]) -> str:
    fair, others = _fair_first(parts)
    scene = html.escape(parts[0].scene)
    body = "".join(_verdict(part) for part in fair)
    folded = "".join(_folded(part.words, _verdict(part, head=False)) for part in others)
    return f'<section class="scene"><h2>{scene}</h2>{body}{folded}</section>\n'


def _folded(words: str, body: str) -> str:
    return f"<details><summary>{html.escape(words)}</summary>{body}</details>"


def _verdict(part: _Part, *, head: bool = True) -> str:
    title = f"<h3>{html.escape(part.words)}</h3>" if head else ""
    lead = f'<p class="lead">{sentence(part.differences)}</p>'
    shown = [d for d in part.differences if d.metric in INTERVAL_METRICS]
    if not shown:
        return title + lead
    extent = min(d.low for d in shown), max(d.high for d in shown)
    charts = ""
    for metric, words in INTERVAL_METRICS.items():
        own = [d for d in shown if d.metric == metric]
        if own:
            label = f"{words} of {own[0].a} minus that of others: {part.scene}, {part.words}"
            wide, narrow = (
                interval_chart(own, width, extent=extent, label=label) for width in (500, 350)
            )
            charts += f"<div><h4>{words}</h4>{both_sizes(wide, narrow)}</div>"
    return f'{title}{lead}<div class="pair">{charts}</div>{_all_differences(part)}'


def _all_differences(part: _Part) -> str:
    rows = "".join(
        f"<tr><td>{html.escape(d.b)}</td><td>{d.n_views}</td><td>{MEASURES[d.metric].title}</td>"
        f"<td>{signed(d.difference, 3)}</td><td>{signed(d.low, 3)} … {signed(d.high, 3)}</td>"
        f"<td>{verdict(d, less_is_better=MEASURES[d.metric].less_is_better)}</td></tr>"
        for d in part.differences
    )
    heads = "".join(
        f'<th scope="col">{words}</th>'
        for words in ("against", "views", "metric", "difference", "95 % interval", "verdict")
    )
    return (
        "<details><summary>All metrics in numbers</summary>"
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'
        "</div></details>"
    )


def _table_section(evaluation: Evaluation) -> str:
    tables = table_1(evaluation)
    fair = min(table.test_views for table in tables)
    body = "".join(
        f"<h3>{heading(t)}</h3>{_grid(evaluation, t)}" for t in tables if t.test_views == fair
    )
    body += "".join(
        _folded(heading(t), _grid(evaluation, t)) for t in tables if t.test_views != fair
    )
    return (
        '<section><h2>Table 1 of the paper, for these scenes</h2><p class="note">'
        f"{READING} Below each, small, the absolute values, PSNR in dB.</p>{body}</section>\n"
    )


def _grid(evaluation: Evaluation, table: Table) -> str:
    heads = "".join(f'<th scope="col">{head}</th>' for head in column_heads(table))
    rows = ""
    for strategy in table.absolute:
        missing = ["–"] * len(table.columns)
        ratios = ratio_texts(table, strategy) if strategy in table.ratios else missing
        cells = "".join(
            f"<td>{ratio}<small>{absolute}</small></td>"
            for ratio, absolute in zip(ratios, absolute_texts(table, strategy), strict=True)
        )
        kind = ' class="reference"' if strategy == evaluation.reference else ""
        name = html.escape(row_name(evaluation, strategy))
        rows += f'<tr{kind}><th scope="row">{name}</th>{cells}</tr>'
    return (
        f'<div class="scroll"><table><thead><tr><th></th>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _curves_section(evaluation: Evaluation, parts: Sequence[_Part]) -> str:
    fair, others = _fair_first(parts)
    body = "".join(f"<h3>{html.escape(p.words)}</h3>{_curves(evaluation, p)}" for p in fair)
    folded = "".join(_folded(part.words, _curves(evaluation, part)) for part in others)
    scene = html.escape(parts[0].scene)
    return f"<section><h2>{scene}: quality against number of views</h2>{body}{folded}</section>\n"


def _curves(evaluation: Evaluation, part: _Part) -> str:
    charts = ""
    for metric, words in CURVE_METRICS.items():
        points = curve_points(part.results, metric)
        wide, narrow = (
            quality_chart(
                points,
                size,
                strategies=strategies_of(evaluation),
                reference=evaluation.reference,
                label=f"{words} against number of views: {part.scene}, {part.words}",
            )
            for size in ((500, 280), (350, 250))
        )
        charts += f"<div><h4>{words}</h4>{both_sizes(wide, narrow)}</div>"
    return f'<div class="pair">{charts}</div>'


def _worst_section(
    evaluation: Evaluation, parts: Sequence[_Part], out_root: Path, *, most_bytes: int
) -> str:
    fair, _ = _fair_first(parts)
    picked = [
        (part, [_read(case, score, out_root) for case, score in _worst(evaluation, part)])
        for part in fair
    ]
    jpegs = [picture.jpeg for _, pictures in picked for picture in pictures]
    if not jpegs:
        return ""
    fitted = iter(_fitted(jpegs, most_bytes=most_bytes))
    body = ""
    for part, pictures in picked:
        ours = others = ""
        for picture in pictures:
            if picture.case.strategy == evaluation.reference:
                ours += _figure(picture, next(fitted))
            else:
                others += _figure(picture, next(fitted))
        words = f"{part.scene}, {part.words}"
        if ours:
            body += f'<h3>{html.escape(words)}</h3><div class="worst">{ours}</div>'
        if others:
            folded = _folded("The worst view of every other strategy", others)
            body += f'<div class="worst">{folded if ours else _folded(words, others)}</div>'
    return (
        '<section><h2>The worst views</h2><p class="note">What users notice. The test views of the '
        f"lowest PSNR of {html.escape(evaluation.reference)}, and of the others.</p>"
        f"{body}</section>\n"
    )


def _worst(evaluation: Evaluation, part: _Part) -> list[tuple[Case, ViewScore]]:
    """Return the views of lowest PSNR that have a picture, the reference's first."""
    chosen: list[tuple[Case, ViewScore]] = []
    for strategy in reversed(strategies_of(evaluation)):
        shown = [
            (result.case, score)
            for result in part.results
            if result.case.strategy == strategy
            for score in result.scores
            if score.picture is not None
        ]
        shown.sort(key=lambda entry: entry[1].psnr)
        # The same view at another number of views or seed shows little that is new.
        by_view = list({score.view: (case, score) for case, score in reversed(shown)}.values())
        count = WORST_OF_REFERENCE if strategy == evaluation.reference else WORST_OF_OTHERS
        chosen += sorted(by_view, key=lambda entry: entry[1].psnr)[:count]
    return chosen


def _read(case: Case, score: ViewScore, out_root: Path) -> _WorstView:
    jpeg = (out_root / (score.picture or "")).read_bytes()
    if not jpeg.startswith(b"\xff\xd8"):
        raise ValueError(f"need a JPEG as the picture of a worst view, got {score.picture}")
    return _WorstView(case, score, jpeg)


def _figure(picture: _WorstView, jpeg: bytes) -> str:
    case, score = picture.case, picture.score
    notes = (
        f"view {score.view} · {case.n_views} views chosen · SSIM {score.ssim:.3f} · "
        f"FLIP {score.flip:.3f} · {100 * score.coverage:.0f}\u00a0% covered"
    )
    alt = f"Photograph, rendering and error of view {score.view}, {case.strategy}"
    return (
        f"<figure><figcaption><b>{html.escape(case.strategy)}</b><b>{score.psnr:.1f}\u00a0dB</b>"
        f"<span>{notes}</span></figcaption>"
        '<div class="strip"><div><p class="panels"><span>photograph</span><span>rendering</span>'
        f"<span>error</span></p>{jpeg_image(jpeg, alt)}</div></div></figure>"
    )


def _fitted(jpegs: Sequence[bytes], *, most_bytes: int) -> list[bytes]:
    """Return the pictures, all made smaller and coarser until base64 of them fits."""
    most = 3 * most_bytes // 4
    fitted = list(jpegs)
    for width_px, quality in PICTURE_STEPS:
        if sum(len(jpeg) for jpeg in fitted) <= most:
            break
        fitted = [_smaller(jpeg, width_px, quality) for jpeg in jpegs]
    return fitted


def _smaller(jpeg: bytes, width_px: int, quality: int) -> bytes:
    bgr = cv2.imdecode(np.frombuffer(jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("need whole JPEG files as pictures of the worst views, got a broken one")
    height, width = bgr.shape[:2]
    scale = min(1.0, width_px / width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    smaller = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
    return encode_jpeg(cv2.cvtColor(smaller, cv2.COLOR_BGR2RGB).astype(np.uint8), quality=quality)


def _configuration(evaluation: Evaluation) -> str:
    versions = " · ".join(
        f"{html.escape(k)} {html.escape(v)}" for k, v in evaluation.versions.items()
    )
    return (
        "<section><details><summary>Configuration and versions</summary>"
        f"{options_table(evaluation.config)}</details>"
        f'<p class="note">{versions}</p></section>\n'
    )
