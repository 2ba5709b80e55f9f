"""The statistical method in sentences, for the report and for a paper."""

from __future__ import annotations

from peaking.study.analysis.measure_analysis import Analysis, Sensitivity
from peaking.study.analysis.words import MUCH, bounded, decimal
from peaking.study.protocol import Protocol


def method(analysis: Analysis) -> str:
    """Return the statistical method as a paragraph."""
    protocol = analysis.protocol
    alpha = f"{protocol.alpha:g}"
    said = [_tests(protocol, alpha)]
    if protocol.families:
        names = "; ".join(f"{f.name}: {', '.join(f.measures)}" for f in protocol.families)
        said.append(
            f"P-values were corrected by Holm’s method within the families declared before the "
            f"study ({names}); all others are exploratory and not corrected."
        )
    else:
        said.append("No families of hypotheses were declared: p-values are not corrected.")
    said.append(missing(protocol))
    if len(protocol.scenes) > 1 and protocol.scene_use == "all":
        said.append("Values of a participant in a condition are means over the scenes.")
    said.append(
        "Confidence intervals are at 95%: Bonett’s for d_av, Fisher’s z (with the variance under "
        "no effect) for the rank-biserial correlation, noncentral F and χ² for proportions of "
        "variance. "
        "Where a score interval of the rank-biserial differs from that of Fisher’s z by more than "
        f"{bounded(MUCH)}, it is reported too."
    )
    return " ".join(said)


def _tests(protocol: Protocol, alpha: str) -> str:
    several = len(protocol.conditions) > 2
    if protocol.design == "within":
        first = (
            "Normality of the differences was tested by Shapiro–Wilk and homogeneity of variance "
            f"by Levene (about the medians), each at α = {alpha}."
        )
        if several:
            return (
                f"{first} If all were satisfied, a repeated-measures ANOVA was computed (with "
                "Greenhouse–Geisser’s correction if Mauchly’s test rejected sphericity) and "
                "paired t-tests of the pairs; otherwise a Friedman test and Wilcoxon signed-rank "
                "tests. Pairs were corrected by Holm’s method."
            )
        return (
            f"{first} If both were satisfied, a paired t-test was used, otherwise a Wilcoxon "
            "signed-rank test (exact, zero differences dropped). Effects are Cohen’s d_av and the "
            "matched-pairs rank-biserial correlation."
        )
    first = f"Normality in each group was tested by Shapiro–Wilk at α = {alpha}."
    if several:
        return (
            f"{first} If all were normal, Welch’s ANOVA and Welch’s t-tests of the pairs were "
            "used, otherwise a Kruskal–Wallis test and Mann–Whitney tests. Pairs were corrected by "
            "Holm’s method."
        )
    return (
        f"{first} If both were normal, Welch’s t-test was used, otherwise a Mann–Whitney test "
        "(exact). Effects are Cohen’s d_av and the rank-biserial correlation."
    )


def missing(protocol: Protocol) -> str:
    """Return how missing values are treated."""
    if protocol.missing == "listwise":
        return (
            "Missing values: listwise; a participant with any missing value is left out of all "
            "tests."
        )
    return (
        "Missing values: pairwise; a participant without a value in any condition is left out of "
        "the tests of that measure only."
    )


def sensitivity(found: Sensitivity, protocol: Protocol) -> str:
    """Return the smallest effect that a study of this size can detect."""
    of = "d_z" if protocol.design == "within" else "d"
    who = "participants" if protocol.design == "within" else "participants in each group"
    level = (
        f"one test at α = {found.alpha:g}"
        if found.alpha == protocol.alpha
        else f"the strictest step of Holm’s correction, α = {found.alpha:.4g}"
    )
    return (
        f"{found.participants} {who}, {level}: {of} = {decimal(found.t_test)} by a t-test, "
        f"{decimal(found.rank_test)} by a rank test."
    )
