"""Print what the study's analysis does on many simulated studies, as tables for the docs.

.venv/bin/python scripts/study_error_rates.py --studies 1000 --seed 1
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy import special, stats

from peaking.study.protocol import parse_protocol
from peaking.study.simulation.error_rates import (
    LARGE,
    Count,
    Coverage,
    FalsePositives,
    coverage,
    false_positives,
)
from peaking.study.simulation.folder import simulated_protocol
from peaking.study.simulation.truth import PAPER, no_effect
from peaking.study.statistics.intervals import rank_biserials
from peaking.study.statistics.outcome import Result
from peaking.study.statistics.several import friedman, kruskal_wallis, repeated_anova
from peaking.study.statistics.signed_rank_test import (
    null_error,
    rank_biserial,
    score_limits,
    signed_ranks,
)

PARTICIPANTS = 20
SHOWN = ("tct_s", "nct_s", "captures", "s_conf", "satis", "scene_focus", "sus_q4", "sus_q5")
SHOWN += ("sus_q10", "tlx_temporal", "tlx_frustration")


def main() -> None:
    """Simulate, analyse, count, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    text = simulated_protocol(PARTICIPANTS, options.seed)
    protocol = parse_protocol(text, Path("protocol.toml"))
    rng = np.random.default_rng(options.seed)
    print_false_positives(
        false_positives(protocol, no_effect(PAPER), studies=options.studies, rng=rng)
    )
    print_coverage(coverage(protocol, PAPER, studies=options.studies, rng=rng))
    print_rank_biserial(3 * options.studies, rng)
    print_shares(options.studies, rng)


def print_false_positives(found: FalsePositives) -> None:
    """Print the shares of tests and families that are significant without an effect."""
    print("| no effect | significant | 95 % limits | t-test taken |\n|---|---|---|---|")
    for name, count in found.tests.items():
        low, high = count.limits()
        taken = found.parametric[name].share
        print(f"| `{name}` | {count.share:.1%} | {low:.1%} – {high:.1%} | {taken:.0%} |")
    happened = sum(count.happened for count in found.tests.values())
    every = sum(count.of for count in found.tests.values())
    print(f"| all tests | {happened / every:.2%} | | |\n")
    print("| family | any p < α | any Holm p < α | 95 % limits |\n|---|---|---|---|")
    for name, count in found.families.items():
        low, high = count.limits()
        plain = found.uncorrected_families[name].share
        print(f"| {name} | {plain:.1%} | {count.share:.1%} | {low:.1%} – {high:.1%} |")


def print_rank_biserial(samples: int, rng: np.random.Generator) -> None:
    """Print how many intervals of the rank-biserial hold it: by Fisher's z, and score intervals."""
    print("\n| true r_rb | Fisher's z | score |\n|---|---|---|")
    error = null_error(PARTICIPANTS)
    for shift in (0.0, 0.42, 0.84, 1.65):
        true = 2 * float(special.ndtr(np.sqrt(2) * shift)) - 1
        fisher, score = Count(), Count()
        for away in rng.normal(shift, 1.0, (samples, PARTICIPANTS)):
            r = rank_biserial(signed_ranks(away))
            both = rank_biserials("", r, error=error, score=score_limits(r, PARTICIPANTS))
            for count, effect in zip((fisher, score), both, strict=True):
                count.add((effect.low or 0.0) <= true <= (effect.high or 0.0))
        print(f"| {true:.2f} | {fisher.share:.1%} | {score.share:.1%} |")


def print_shares(samples: int, rng: np.random.Generator) -> None:
    """Print how many intervals of shares of variance hold them: three conditions, normal."""
    print("\n| means | partial η² | Kendall's W | rank ε² |\n|---|---|---|---|")
    for means in ((0.0, 0.0, 0.0), (0.0, 0.5, 1.0), (0.0, 1.0, 2.0), (0.0, 2.0, 4.0)):
        many = rng.normal(means, 1.0, (LARGE, 3))
        ncp = PARTICIPANTS * 3 * np.var(means)
        true_eta2 = ncp / (ncp + 2 * (PARTICIPANTS - 1))
        true_w = np.var(stats.rankdata(many, axis=1).mean(axis=0)) / (2 / 3)
        ranks = stats.rankdata(many)
        means_of_ranks = ranks.reshape(many.shape).mean(axis=0)
        true_epsilon2 = np.var(means_of_ranks) / np.var(ranks)
        eta2, w, epsilon2 = Count(), Count(), Count()
        for values in rng.normal(means, 1.0, (samples, PARTICIPANTS, 3)):
            for count, outcome, true in (
                (eta2, repeated_anova(values, spherical=True), true_eta2),
                (w, friedman(values), true_w),
                (epsilon2, kruskal_wallis(list(values.T)), true_epsilon2),
            ):
                if isinstance(outcome, Result):
                    (effect,) = outcome.effects
                    count.add((effect.low or 0.0) <= true <= (effect.high or 0.0))
        cells = [
            f"{true:.2f}: {count.share:.1%}"
            for true, count in ((true_eta2, eta2), (true_w, w), (true_epsilon2, epsilon2))
        ]
        print(f"| {', '.join(f'{m:g}' for m in means)} | " + " | ".join(cells) + " |")


def print_coverage(found: Coverage) -> None:
    """Print how many intervals hold what is true."""
    symbols = ("d_av", "d_z", "M_diff", "r_rb", "r_rb, score", "HL")
    print("\n| measure | significant | t-test taken | " + " | ".join(symbols) + " |")
    print("|---|---|---|" + "---|" * len(symbols))
    for name in SHOWN:
        cells: list[str] = []
        for symbol in symbols:
            true = found.truths[symbol.removesuffix(", score")][name]
            cells.append(f"{true:.2f}: {found.held[symbol][name].share:.1%}")
        power, taken = found.significant[name].share, found.parametric[name].share
        print(f"| `{name}` | {power:.0%} | {taken:.0%} | " + " | ".join(cells) + " |")
    for symbol in symbols:
        happened = sum(count.happened for count in found.held[symbol].values())
        every = sum(count.of for count in found.held[symbol].values())
        print(f"{symbol}: {happened / every:.2%} of {every} intervals")


if __name__ == "__main__":
    main()
