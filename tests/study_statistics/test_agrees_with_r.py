"""Every statistic, p-value, effect size and interval is R's; see tests/oracles/study.R."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from statsmodels.stats.anova import AnovaRM

from peaking.study.statistics.assumptions import greenhouse_geisser, levene, mauchly, shapiro_wilk
from peaking.study.statistics.groups import mann_whitney, welch_t
from peaking.study.statistics.holm_correction import holm
from peaking.study.statistics.order_effect_tests import order_effects
from peaking.study.statistics.outcome import Effect, Outcome, Result
from peaking.study.statistics.paired import paired_t, wilcoxon
from peaking.study.statistics.power import (
    power_paired_t,
    power_two_sample_t,
    smallest_effect,
)
from peaking.study.statistics.samples import differences
from peaking.study.statistics.several import (
    friedman,
    kruskal_wallis,
    repeated_anova,
    welch_anova,
)

ORACLES = Path(__file__).parent.parent / "oracles"
CASES: Any = json.loads((ORACLES / "study_cases.json").read_text(encoding="utf-8"))
R: Any = json.loads((ORACLES / "study_r.json").read_text(encoding="utf-8"))

# All relative; the worst measured stands behind each. R prints 15 digits.
CLOSED_FORM = 1e-11  # 5.7e-14
ANOVA = 1e-9  # 3.0e-10: R goes through the decomposition of a linear model
TURNED_ROUND = 1e-7  # 9.9e-8: limits found by search; R's pf and pt with ncp stop at 1e-9
SHAPIRO = 1e-7  # 9.7e-9: both use Royston's approximation
BY_EFFECTSIZE = 2e-4  # 1.3e-4: effectsize searches its limits with a coarse stop
MAUCHLY_PUBLISHED = 3e-3  # 1.2e-3: the formula as published, for four or more conditions


def result(outcome: Outcome) -> Result:
    assert isinstance(outcome, Result), outcome
    return outcome


def same(ours: float | None, of_r: float, tolerance: float) -> None:
    assert ours == pytest.approx(of_r, rel=tolerance, abs=tolerance * 1e-3)


def same_effect(
    effect: Effect, of_r: list[float], limits: float, *, value: float = CLOSED_FORM
) -> None:
    same(effect.value, of_r[0], value)
    same(effect.low, of_r[1], limits)
    same(effect.high, of_r[2], limits)


def same_test(outcome: Outcome, of_r: Any, tolerance: float = CLOSED_FORM) -> None:
    ours = result(outcome)
    same(ours.statistic, of_r["statistic"], tolerance)
    same(ours.p, of_r["p"], tolerance)
    if "df" in of_r:
        expected = of_r["df"] if isinstance(of_r["df"], list) else [of_r["df"]]
        assert ours.df == pytest.approx(expected, rel=CLOSED_FORM)


def pair(name: str) -> tuple[np.ndarray, np.ndarray]:
    case = CASES["paired"][name]
    return np.array(case["first"], dtype=np.float64), np.array(case["second"], dtype=np.float64)


PAIRED = list(CASES["paired"])
SPREAD = [name for name in PAIRED if "t" in R["paired"][name]]
REPEATED = list(CASES["repeated"])
TWO = [name for name, samples in CASES["groups"].items() if len(samples) == 2]
MORE = [name for name in CASES["groups"] if name not in TWO]


@pytest.mark.parametrize("name", PAIRED)
def test_levene(name: str) -> None:
    same_test(levene(list(pair(name))), R["paired"][name]["levene"])


@pytest.mark.parametrize("name", SPREAD)
def test_shapiro_wilk_of_differences(name: str) -> None:
    same_test(shapiro_wilk(differences(*pair(name))), R["paired"][name]["shapiro"], SHAPIRO)


@pytest.mark.parametrize("name", SPREAD)
def test_paired_t_with_its_three_effects(name: str) -> None:
    ours, of_r = result(paired_t(*pair(name))), R["paired"][name]["t"]
    same_test(ours, of_r)
    d_av, d_z, mean = ours.effects
    same_effect(d_av, of_r["d_av"], CLOSED_FORM)
    same_effect(d_z, of_r["d_z"], TURNED_ROUND)
    same_effect(d_z, of_r["d_z_effectsize"], BY_EFFECTSIZE)
    same_effect(mean, of_r["mean_difference"], CLOSED_FORM)


@pytest.mark.parametrize("name", PAIRED)
def test_wilcoxon_with_its_effects(name: str) -> None:
    ours, of_r = result(wilcoxon(*pair(name))), R["paired"][name]["wilcoxon"]
    same(ours.statistic, of_r["statistic"], CLOSED_FORM)
    if ours.remarks[0] == "p-value: exact":
        same(ours.p, of_r["p_exact"], CLOSED_FORM)
        same(ours.p, of_r["p_coin"], CLOSED_FORM)
        if of_r["base_is_exact"]:
            same(ours.p, of_r["p_base"], CLOSED_FORM)
    else:
        same(ours.p, of_r["p_base"], CLOSED_FORM)
    fisher, score, hodges_lehmann = ours.effects
    same_effect(fisher, of_r["r_effectsize"], CLOSED_FORM)
    same_effect(score, [of_r["r"], *of_r["r_limits"]], TURNED_ROUND)
    if "hodges_lehmann" in of_r:
        same_effect(hodges_lehmann, of_r["hodges_lehmann"], CLOSED_FORM)
    if "hodges_lehmann_base" in of_r:
        same_effect(hodges_lehmann, of_r["hodges_lehmann_base"], CLOSED_FORM)


@pytest.mark.parametrize("name", REPEATED)
def test_sphericity_and_repeated_anova(name: str) -> None:
    values, of_r = np.array(CASES["repeated"][name], dtype=np.float64), R["repeated"][name]
    same(result(mauchly(values)).statistic, of_r["mauchly"]["statistic"], ANOVA)
    same(result(mauchly(values)).p, of_r["mauchly"]["p_base"], ANOVA)
    same(result(mauchly(values)).p, of_r["mauchly"]["p"], MAUCHLY_PUBLISHED)
    same(greenhouse_geisser(values), of_r["epsilon"], CLOSED_FORM)
    same_test(levene(list(values.T)), of_r["levene"])
    spherical = result(repeated_anova(values, spherical=True))
    same_test(spherical, of_r["anova"], ANOVA)
    same_eta2(spherical.effects[0], of_r["anova"]["eta2"])
    corrected = result(repeated_anova(values, spherical=False))
    same(corrected.statistic, of_r["anova"]["statistic"], ANOVA)
    same(corrected.p, of_r["anova"]["p_gg"], ANOVA)
    same_eta2(corrected.effects[0], of_r["anova"]["eta2_gg"])


def same_eta2(effect: Effect, of_r: list[float]) -> None:
    same_effect(effect, of_r[:3], TURNED_ROUND, value=ANOVA)
    same_effect(effect, [of_r[0], *of_r[3:]], BY_EFFECTSIZE, value=ANOVA)


@pytest.mark.parametrize("name", REPEATED)
def test_repeated_anova_agrees_with_statsmodels(name: str) -> None:
    values = np.array(CASES["repeated"][name], dtype=np.float64)
    rows, columns = np.indices(values.shape)
    table = {"value": values.ravel(), "who": rows.ravel(), "condition": columns.ravel()}
    theirs = AnovaRM(pd.DataFrame(table), "value", "who", within=["condition"]).fit().anova_table
    ours = result(repeated_anova(values, spherical=True))
    same(ours.statistic, theirs["F Value"].iloc[0], ANOVA)
    same(ours.p, theirs["Pr > F"].iloc[0], ANOVA)


@pytest.mark.parametrize("name", REPEATED)
def test_friedman_with_kendalls_w(name: str) -> None:
    ours = result(friedman(np.array(CASES["repeated"][name], dtype=np.float64)))
    of_r = R["repeated"][name]["friedman"]
    same_test(ours, of_r)
    same_effect(ours.effects[0], [of_r["w"], *of_r["w_limits"]], TURNED_ROUND)


def groups(name: str) -> list[np.ndarray]:
    return [np.array(sample, dtype=np.float64) for sample in CASES["groups"][name]]


@pytest.mark.parametrize("name", [*TWO, *MORE])
def test_assumptions_of_groups(name: str) -> None:
    same_test(levene(groups(name)), R["groups"][name]["levene"])
    of_r = R["groups"][name]["shapiro"]
    for sample, expected in zip(
        groups(name), of_r if isinstance(of_r, list) else of_r.values(), strict=True
    ):
        same_test(shapiro_wilk(sample), expected, SHAPIRO)


@pytest.mark.parametrize("name", TWO)
def test_welch_t_and_mann_whitney(name: str) -> None:
    welch, of_r = result(welch_t(*groups(name))), R["groups"][name]["welch"]
    same_test(welch, of_r)
    same_effect(welch.effects[0], of_r["d_av"], CLOSED_FORM)
    same_effect(welch.effects[1], of_r["mean_difference"], CLOSED_FORM)
    whitney, of_r = result(mann_whitney(*groups(name))), R["groups"][name]["mann_whitney"]
    same(whitney.statistic, of_r["statistic"], CLOSED_FORM)
    exact = whitney.remarks[0] == "p-value: exact"
    same(whitney.p, of_r["p_exact"] if exact else of_r["p_base"], CLOSED_FORM)
    if of_r["base_is_exact"]:
        same(whitney.p, of_r["p_base"], CLOSED_FORM)
    fisher, score = whitney.effects
    same_effect(fisher, of_r["r_effectsize"], CLOSED_FORM)
    same_effect(score, [of_r["r"], *of_r["r_limits"]], TURNED_ROUND)


@pytest.mark.parametrize("name", MORE)
def test_welch_anova_and_kruskal_wallis(name: str) -> None:
    welch, of_r = result(welch_anova(groups(name))), R["groups"][name]["welch_anova"]
    same_test(welch, of_r)
    same_eta2(welch.effects[0], of_r["eta2"])
    kruskal, of_r = result(kruskal_wallis(groups(name))), R["groups"][name]["kruskal"]
    same_test(kruskal, of_r)
    same_effect(kruskal.effects[0], [of_r["epsilon2"], *of_r["epsilon2_limits"]], TURNED_ROUND)


def test_order_effects_of_a_crossover() -> None:
    case, of_r = CASES["crossover"]["order"], R["crossover"]["order"]
    began = np.array(case["first_began"])
    places = np.stack((~began, began), axis=1).astype(int)
    values = np.array((case["first"], case["second"]), dtype=np.float64).T
    ours = order_effects(values, places)
    same_test(ours.period, of_r["period"])
    same_test(ours.carry_over, of_r["carry_over"])


@pytest.mark.parametrize("index", range(len(CASES["families"])))
def test_holm(index: int) -> None:
    of_r = R["families"][index]
    expected = of_r if isinstance(of_r, list) else [of_r]
    assert holm(CASES["families"][index]) == pytest.approx(expected, rel=CLOSED_FORM)


@pytest.mark.parametrize("index", range(len(CASES["power"])))
def test_power(index: int) -> None:
    case, of_r = CASES["power"][index], R["power"][index]
    n, d, alpha = float(case["n"]), case["d"], case["alpha"]
    same(power_paired_t(d, n=n, alpha=alpha), of_r["paired"], TURNED_ROUND)
    same(power_two_sample_t(d, n=n, alpha=alpha), of_r["two_sample"], TURNED_ROUND)
    paired = smallest_effect(n=n, alpha=alpha, paired=True)
    same(paired, of_r["smallest_paired"], TURNED_ROUND)
    two_sample = smallest_effect(n=n, alpha=alpha, paired=False)
    same(two_sample, of_r["smallest_two_sample"], TURNED_ROUND)
