"""Every number that a trial has, and what it is: the columns of the tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from peaking.study.questionnaires import Item, Questionnaire
from peaking.study.questionnaires.scoring import scores


@dataclass(frozen=True)
class Measure:
    """One column: what the number is."""

    name: str
    label: str
    unit: str
    """`s`, `views`, `%`, `points` … ; empty for answers on a scale."""
    kind: Literal["time", "count", "share", "score", "item"]
    description: str
    low: float | None = None
    """Smallest value that can be; None: no limit."""
    high: float | None = None


def _m(
    name: str, label: str, unit: str, *, kind: Literal["time", "count", "share"], description: str
) -> Measure:
    high = 100.0 if kind == "share" else None
    return Measure(name, label, unit, kind, description, low=0.0, high=high)


TASK_MEASURES = (
    _m(
        "tct_s",
        "Task completion time",
        "s",
        kind="time",
        description="From the first picture in which the shutter worked to Finish",
    ),
    _m(
        "nct_s",
        "Net completion time",
        "s",
        kind="time",
        description="TCT without waiting for communication and generation",
    ),
    _m(
        "waiting_s",
        "Waiting",
        "s",
        kind="time",
        description="Time in which a captured view was not yet part of the reconstruction",
    ),
    _m(
        "interrupted_s",
        "Interruptions",
        "s",
        kind="time",
        description="Time in which the page was closed or reloading; not part of TCT",
    ),
    _m("scan_s", "Scanning", "s", kind="time", description="Scan of the scene, before the capture"),
    _m("captures", "Captured views", "views", kind="count", description="Without undone ones"),
    _m("undone", "Undone views", "views", kind="count", description="Undone by the participant"),
    _m(
        "peaked_mean",
        "Peaked share, mean",
        "%",
        kind="share",
        description="Mean share of peaked pixels during the task",
    ),
    _m(
        "peaked_at_shutter",
        "Peaked share at the shutter",
        "%",
        kind="share",
        description="Mean over the views of the last share measured before each was taken",
    ),
    _m(
        "peaked_last",
        "Peaked share at the end",
        "%",
        kind="share",
        description="Last share measured in the task",
    ),
    _m(
        "tracking_losses",
        "Tracking losses",
        "",
        kind="count",
        description="How often the phone lost its position",
    ),
    _m(
        "tracking_lost_s",
        "Time without tracking",
        "s",
        kind="time",
        description="How long the phone did not know its position",
    ),
)


def catalogue(asked: Sequence[Questionnaire]) -> list[Measure]:
    """Return all measures of a trial in which these are asked, in the order of the tables."""
    return [*TASK_MEASURES, *(m for form in asked for m in _score_measures(form))]


def column(questionnaire: Questionnaire, score: str) -> str:
    """Return the name of a score in tables: `sus`, `sus_q1`, `tlx_raw`, `s_conf`."""
    prefix = questionnaire.name if questionnaire.prefix is None else questionnaire.prefix
    return "_".join(part for part in (prefix, score) if part) or questionnaire.name


_SCORE_WORDS = {
    "sus": {"": "System usability (SUS)"},
    "harus": {
        "": "Usability of handheld AR (HARUS)",
        "manipulability": "HARUS: manipulability",
        "comprehensibility": "HARUS: comprehensibility",
    },
    "nasa_tlx": {"raw": "Workload (raw TLX)", "weighted": "Workload (weighted TLX)"},
    "nasa_rtlx": {"raw": "Workload (raw TLX)"},
}


def _score_measures(questionnaire: Questionnaire) -> list[Measure]:
    words = _SCORE_WORDS.get(questionnaire.scoring, {"": f"{questionnaire.title}: mean"})
    items = {item.id: item for item in questionnaire.items}
    found: list[Measure] = []
    for score in scores(questionnaire, {}):
        name = column(questionnaire, score)
        if score in items:
            found.append(_item_measure(name, items[score]))
        else:
            high = 100.0 if questionnaire.scoring in _SCORE_WORDS else None
            label = words[score]
            low = 0.0 if high is not None else None
            found.append(
                Measure(name, label, "points", "score", questionnaire.source, low=low, high=high)
            )
    return found


def _item_measure(name: str, item: Item) -> Measure:
    low, high = {
        "scale": (1.0, float(item.points)),
        "rating": (0.0, 100.0),
    }.get(item.kind, (item.smallest, item.largest))
    ends = f" ({item.low} … {item.high})" if item.low else ""
    return Measure(name, item.text, "", "item", item.text + ends, low=low, high=high)
