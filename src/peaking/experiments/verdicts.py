"""What an evaluation says, in one sentence: better, worse or the same, beyond the interval."""

from __future__ import annotations

import html
from collections.abc import Sequence

from peaking.experiments.curves import signed, verdict
from peaking.experiments.results import Difference

OPENINGS = {"psnr": "In the mean", "psnr_p5": "in the worst views"}
"""The metrics that a verdict speaks of, both in dB."""

JUDGED = {"better": "better than", "worse": "worse than", "same": "no different from"}


def sentence(differences: Sequence[Difference]) -> str:
    """Say how the reference stands to the other strategies, as HTML.

    A strategy is counted as better (or worse) when the interval is on that side of 0 for at least
    one number of views and on the other side for none; in how many cases is said where not in all.

    Args:
        differences: Of one scene, reconstruction and choice of test views.
    """
    if not any(d.metric in OPENINGS for d in differences):
        return "There is nothing to compare: no other strategy has as many views."
    parts = [
        f"{opening} <b>{html.escape(differences[0].a)}</b> is {_clause(own)}"
        if metric == "psnr"
        else f"{opening} it is {_clause(own)}"
        for metric, opening in OPENINGS.items()
        if (own := [d for d in differences if d.metric == metric])
    ]
    text = "; ".join(parts) + "."
    return text[0].upper() + text[1:]


def _clause(differences: Sequence[Difference]) -> str:
    by_kind: dict[str, list[list[Difference]]] = {
        "better": [],
        "worse": [],
        "same": [],
        "mixed": [],
    }
    others = list(dict.fromkeys(d.b for d in differences))
    for other in others:
        own = [d for d in differences if d.b == other]
        sides = {verdict(d) for d in own} - {"same"}
        by_kind["mixed" if len(sides) == 2 else next(iter(sides), "same")].append(own)
    said: list[str] = []
    for kind, words in JUDGED.items():
        if by_kind[kind]:
            everyone = len(by_kind[kind]) == len(others) > 1
            names = _everyone(kind, by_kind[kind]) if everyone else _names(kind, by_kind[kind])
            said.append(f'<b class="{kind}">{words}</b> {names}{_range(kind, by_kind[kind])}')
    if by_kind["mixed"]:
        said.append(f"better or worse than {_names('mixed', by_kind['mixed'])} by number of views")
    return ", ".join(said)


def _everyone(kind: str, groups: Sequence[Sequence[Difference]]) -> str:
    verdicts = [verdict(d) for group in groups for d in group]
    return f"all {len(groups)} others{_how_often(kind, verdicts)}"


def _names(kind: str, groups: Sequence[Sequence[Difference]]) -> str:
    return _listed(
        [
            html.escape(group[0].b) + _how_often(kind, [verdict(d) for d in group])
            for group in groups
        ]
    )


def _how_often(kind: str, verdicts: Sequence[str]) -> str:
    count = verdicts.count(kind)
    if kind == "mixed" or count == len(verdicts):
        return ""
    return f" (in {count} of {len(verdicts)} cases)"


def _range(kind: str, groups: Sequence[Sequence[Difference]]) -> str:
    """Return by how much, where it is beyond the interval."""
    values = sorted(
        (d.difference for group in groups for d in group if verdict(d) == kind), key=abs
    )
    if kind == "same":
        return ""
    low, high = signed(values[0], 1), signed(values[-1], 1)
    return f" by {low}\u00a0dB" if low == high else f" by {low} to {high}\u00a0dB"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
