"""Participants' numbers, drawn from what is true in the population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from peaking.study.questionnaires import built_in
from peaking.study.questionnaires.scoring import scores
from peaking.study.simulation.truth import CORRELATION, Truth

Drawn = Mapping[str, Float64[np.ndarray, "participants conditions"]]


def draw(truths: Sequence[Truth], count: int, rng: np.random.Generator) -> Drawn:
    """Draw the numbers of `count` participants: one array per measure, a column per condition.

    Measures are independent of each other; the conditions of one are correlated by `CORRELATION`.
    TCT, the whole SUS and the raw TLX follow from their parts.
    """
    found = {truth.measure: draw_one(truth, count, rng) for truth in truths}
    if "nct_s" in found and "waiting_s" in found:
        found["tct_s"] = found["nct_s"] + found["waiting_s"]
    for name, score, prefix in (("sus", "", "sus"), ("nasa_rtlx", "raw", "tlx")):
        items = [item.id for item in built_in(name).items]
        parts = [found.get(f"{prefix}_{item}") for item in items]
        if all(part is not None for part in parts):
            whole = f"{prefix}_{score}".rstrip("_")
            found[whole] = _scored(name, score, {i: found[f"{prefix}_{i}"] for i in items})
    return found


def draw_one(
    truth: Truth, count: int, rng: np.random.Generator
) -> Float64[np.ndarray, "participants conditions"]:
    """Draw one measure."""
    conditions = len(truth.means)
    shared = rng.standard_normal((count, 1))
    own = rng.standard_normal((count, conditions))
    latent = np.sqrt(CORRELATION) * shared + np.sqrt(1 - CORRELATION) * own
    numbers: np.ndarray = np.array(truth.means) + np.array(truth.sds) * latent
    if truth.step:
        numbers = np.round(numbers / truth.step) * truth.step
    return np.clip(numbers, truth.low, truth.high)


def _scored(
    questionnaire: str, score: str, answers: Drawn
) -> Float64[np.ndarray, "participants conditions"]:
    form = built_in(questionnaire)
    shape = next(iter(answers.values())).shape
    whole = np.empty(shape)
    for cell in np.ndindex(shape):
        given = {item: float(values[cell]) for item, values in answers.items()}
        value = scores(form, given)[score]
        whole[cell] = np.nan if value is None else value
    return whole
