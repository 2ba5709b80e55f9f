"""The results as tables: each figure, the paper's plain rule beside it, and the aim."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Row = tuple[str, object, object, str]
"""What it is, ours, the paper's, the aim."""


def as_markdown(document: Mapping[str, Any]) -> str:
    """Return a results file as markdown."""
    lines: list[str] = []
    for scene in document["scenes"]:
        lines += [f"## {scene['scene']}", "", "| | ours | paper | aim |", "|---|---:|---:|---|"]
        for name, rows in ROWS.items():
            if name in scene:
                lines += [
                    f"| {label} | {_number(ours)} | {_number(paper)} | {aim} |"
                    for label, ours, paper, aim in rows(scene[name])
                ]
        lines.append("")
    return "\n".join(lines)


def _seen(result: Mapping[str, Any]) -> Iterator[Row]:
    for count, ours in result["after"].items():
        papers = result["paper"]["after"][count]
        yield f"seen: truly never seen, {count} views", ours["true_share"], papers["true_share"], ""
        for figure in ("precision", "recall"):
            yield (
                f"seen: {figure} after {count} views",
                ours[figure],
                papers[figure],
                "≥ 0.95, real ≥ 0.9",
            )
            blind = ours["without_live_depth"][figure]
            yield f"seen: {figure} after {count} views, no live depth", blind, None, ""
            for surface in ("dark", "bright"):
                yield (
                    f"seen: {figure} after {count} views, {surface}",
                    ours["surfaces"][surface][figure],
                    papers["surfaces"][surface][figure],
                    "the same",
                )
        yield (
            f"seen: never seen and unmarked, {count} views",
            ours["unmarked_share"],
            papers["unmarked_share"],
            "",
        )


def _false_red(result: Mapping[str, Any]) -> Iterator[Row]:
    for name, share in result["shares"].items():
        yield f"false_red: {name}", share, result["paper"]["shares"][name], "< 0.01"


def _true_red(result: Mapping[str, Any]) -> Iterator[Row]:
    papers = result["paper"]
    yield "true_red: auc", result["auc"], papers["auc"], "above the paper's"
    yield "true_red: precision", result["precision"], papers["precision"], ""
    yield "true_red: recall", result["recall"], papers["recall"], ""
    yield (
        "true_red: recall at the paper's precision",
        result["recall_at_papers_precision"],
        papers["recall"],
        "≥ 0.9 of the paper's",
    )
    for what in ("kinds", "disturbances"):
        for name, ours in result[what].items():
            paper = papers[what][name]
            yield f"true_red: {name}: auc", ours["auc"], paper["auc"], ""
            yield f"true_red: {name}: recall", ours["recall"], paper["recall"], ""


def _useful(result: Mapping[str, Any]) -> Iterator[Row]:
    papers = result["paper"]
    yield "useful: Pearson", result["pearson"], papers["pearson"], "≥ 0.6"
    yield (
        "useful: Pearson, red of what was seen",
        result["pearson_wrong_only"],
        papers["pearson_wrong_only"],
        "",
    )


def _steady(result: Mapping[str, Any]) -> Iterator[Row]:
    papers = result["paper"]
    for key, label, aim in (
        ("changes_per_s", "state changes per pixel and second", ""),
        ("largest_jump_pp", "largest change between frames, points", "≤ 1"),
        ("median_jump_pp", "median change between frames, points", ""),
    ):
        yield f"steady: {label}", result[key], papers[key], aim


def _classes(result: Mapping[str, Any]) -> Iterator[Row]:
    papers = result["paper"]
    if papers is None:
        yield "classes", None, None, ""
        return
    for truth, recall in result["recall"].items():
        yield f"classes: {truth} recalled", recall, papers["recall"][truth], "≥ 0.8"
    yield (
        "classes: mendable called unfixable",
        result["unfixable_of_mendable"],
        papers["unfixable_of_mendable"],
        "≤ 0.02",
    )


def _pose(result: Mapping[str, Any]) -> Iterator[Row]:
    for name, share in result["red"].items():
        yield f"pose: red, {name}", share, result["paper"]["red"][name], ""
    for unit, label in (("error_mm", "mm"), ("error_deg", "°")):
        for name, off in result[unit].items():
            yield f"pose: off, {name}, {label}", off, None, ""


ROWS = {
    "seen": _seen,
    "false_red": _false_red,
    "true_red": _true_red,
    "useful": _useful,
    "steady": _steady,
    "classes": _classes,
    "pose": _pose,
}


def _number(value: object) -> str:
    if not isinstance(value, int | float):
        return "n/a"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
