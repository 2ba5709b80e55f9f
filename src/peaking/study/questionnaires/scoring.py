"""The published scoring rules.

- SUS: J. Brooke, "SUS: a quick and dirty usability scale", 1996.
- NASA-TLX: S. Hart, L. Staveland, 1988; *raw* (RTLX) is the mean of the six ratings.
- HARUS: M. E. C. Santos et al., "A usability scale for handheld augmented reality", VRST 2014
  (not checked against its text: docs/study.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from peaking.study.questionnaires import Answer, Questionnaire

TLX_SCALES: tuple[str, ...] = (
    "mental",
    "physical",
    "temporal",
    "performance",
    "effort",
    "frustration",
)
TLX_PAIRS = tuple(combinations(TLX_SCALES, 2))
"""The 15 pairs; the item of a pair is `pair_` + both names, its answer the weightier one's name."""


def scores(questionnaire: Questionnaire, answers: Mapping[str, Answer]) -> dict[str, float | None]:
    """Return the scores of a filled-in form, by name without the questionnaire's own name.

    The whole score has the empty name where there is one: `sus` is `{"": 72.5, "q1": 4.0, …}`.
    A score of which an answer is missing is None; no answer is made up.

    Items that are scales, ratings or numbers are scores of their own, as answered (not reversed).
    """
    given: dict[str, float | None] = {}
    for item in questionnaire.items:
        if item.kind in ("scale", "rating", "number"):
            answer = answers.get(item.id)
            given[item.id] = float(answer) if isinstance(answer, int | float) else None
    match questionnaire.scoring:
        case "items":
            return given
        case "mean":
            return {"": _mean(_turned(questionnaire, given)), **given}
        case "sus":
            return {"": _times(_sum(_points(questionnaire, given)), 2.5), **given}
        case "harus":
            points = _points(questionnaire, given)
            return {
                "": _percent(_sum(points), 96.0),
                "manipulability": _percent(_sum(points[:8]), 48.0),
                "comprehensibility": _percent(_sum(points[8:]), 48.0),
                **given,
            }
        case "nasa_rtlx":
            return {"raw": _mean([given.get(name) for name in TLX_SCALES]), **given}
        case "nasa_tlx":
            ratings = [given.get(name) for name in TLX_SCALES]
            return {"raw": _mean(ratings), "weighted": _weighted(ratings, answers), **given}


def tlx_weights(answers: Mapping[str, Answer]) -> dict[str, int] | None:
    """Return how often each scale was the weightier one of its pairs: 0 … 5, together 15.

    None when a pair was not answered.
    """
    weights: dict[str, int] = dict.fromkeys(TLX_SCALES, 0)
    for first, second in TLX_PAIRS:
        chosen = answers.get(f"pair_{first}_{second}")
        if chosen not in (first, second):
            return None
        weights[str(chosen)] += 1
    return weights


def _weighted(ratings: Sequence[float | None], answers: Mapping[str, Answer]) -> float | None:
    weights = tlx_weights(answers)
    if weights is None:
        return None
    products = [
        None if rating is None else weights[name] * rating
        for name, rating in zip(TLX_SCALES, ratings, strict=True)
    ]
    return _times(_sum(products), 1 / 15)


def _points(questionnaire: Questionnaire, given: Mapping[str, float | None]) -> list[float | None]:
    """Return per item 0 … points - 1: answer - 1, or points - answer where it is reversed."""
    found: list[float | None] = []
    for item in questionnaire.items:
        answer = given.get(item.id)
        if answer is None:
            found.append(None)
        else:
            found.append(item.points - answer if item.reversed else answer - 1)
    return found


def _turned(questionnaire: Questionnaire, given: Mapping[str, float | None]) -> list[float | None]:
    found: list[float | None] = []
    for item in questionnaire.items:
        if item.id not in given:
            continue
        answer = given[item.id]
        turn = answer is not None and item.reversed and item.kind == "scale"
        found.append(item.points + 1 - answer if turn and answer is not None else answer)
    return found


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) if len(known) == len(values) and known else None


def _mean(values: Sequence[float | None]) -> float | None:
    return _times(_sum(values), 1 / max(len(values), 1))


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _percent(value: float | None, most: float) -> float | None:
    return None if value is None else 100.0 * value / most
