"""Print what the study's analysis does on many simulated studies, as tables for the docs.

.venv/bin/python scripts/study_error_rates.py --studies 1000 --seed 1
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from peaking.study.protocol import parse_protocol
from peaking.study.simulation.error_rates import Coverage, FalsePositives, coverage, false_positives
from peaking.study.simulation.folder import simulated_protocol
from peaking.study.simulation.truth import PAPER, no_effect

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


def print_coverage(found: Coverage) -> None:
    """Print how many intervals hold what is true."""
    symbols = ("d_av", "d_z", "M_diff", "r_rb", "HL")
    print("\n| measure | significant | t-test taken | " + " | ".join(symbols) + " |")
    print("|---|---|---|" + "---|" * len(symbols))
    for name in SHOWN:
        cells = [
            f"{found.truths[symbol][name]:.2f}: {found.held[symbol][name].share:.1%}"
            for symbol in symbols
        ]
        power, taken = found.significant[name].share, found.parametric[name].share
        print(f"| `{name}` | {power:.0%} | {taken:.0%} | " + " | ".join(cells) + " |")
    for symbol in symbols:
        happened = sum(count.happened for count in found.held[symbol].values())
        every = sum(count.of for count in found.held[symbol].values())
        print(f"{symbol}: {happened / every:.2%} of {every} intervals")


if __name__ == "__main__":
    main()
