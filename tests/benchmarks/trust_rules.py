"""Rules that must not do well in `peaking bench trust`, and one that must."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from peaking.benchmarks.trust import false_red, true_red
from peaking.benchmarks.trust.judge import Judgement

Asked = false_red.Question | true_red.Question
Rule = Callable[[Asked], Judgement]


def _says(score: np.ndarray, red: np.ndarray) -> Judgement:
    nowhere = np.zeros_like(red)
    return Judgement(score.astype(np.float32), red, nowhere, nowhere)


def nothing(asked: Asked) -> Judgement:
    shape = asked.live.shape[:2]
    return _says(np.zeros(shape), np.zeros(shape, bool))


def everything(asked: Asked) -> Judgement:
    shape = asked.live.shape[:2]
    return _says(np.full(shape, 3.0), np.ones(shape, bool))


def at_random(asked: Asked) -> Judgement:
    """Red a tenth of the pixels, whatever they show."""
    score = np.random.default_rng(int(asked.live.sum())).random(asked.live.shape[:2])
    return _says(score, score > 0.9)


def oracle(asked: Asked) -> Judgement:
    """Know the truth."""
    if isinstance(asked, false_red.Question):
        return nothing(asked)
    return _says(asked.wrong.astype(np.float64), asked.wrong)
