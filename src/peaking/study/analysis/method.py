"""What was done, in sentences: for the report, and to paste into a paper."""

from __future__ import annotations

from peaking.study.analysis.analyse import Analysis, Sensitivity
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
        said.append("Numbers of a participant in a condition are means over the scenes.")
    said.append(
        "Confidence intervals are at 95%: Bonett’s for d_av, Fisher’s z (with the variance of no "
        "effect) for the rank-biserial correlation, noncentral F and χ² for shares of variance. "
        "Where a score interval of the rank-biserial differs from that of Fisher’s z by more than "
        f"{bounded(MUCH)}, it is given too."
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
                f"{first} Where all were satisfied, a repeated-measures ANOVA was made (with "
                "Greenhouse–Geisser’s correction where Mauchly’s test rejected sphericity) and "
                "paired t-tests of the pairs; otherwise a Friedman test and Wilcoxon signed-rank "
                "tests. Pairs were corrected by Holm’s method."
            )
        return (
            f"{first} Where both were satisfied, a paired t-test was made, otherwise a Wilcoxon "
            "signed-rank test (exact, zero differences dropped). Effects are Cohen’s d_av and the "
            "matched-pairs rank-biserial correlation."
        )
    first = f"Normality in each group was tested by Shapiro–Wilk at α = {alpha}."
    if several:
        return (
            f"{first} Where all were normal, Welch’s ANOVA and Welch’s t-tests of the pairs were "
            "made, otherwise a Kruskal–Wallis test and Mann–Whitney tests. Pairs were corrected by "
            "Holm’s method."
        )
    return (
        f"{first} Where both were normal, Welch’s t-test was made, otherwise a Mann–Whitney test "
        "(exact). Effects are Cohen’s d_av and the rank-biserial correlation."
    )


def missing(protocol: Protocol) -> str:
    """Return what is done about missing numbers."""
    if protocol.missing == "listwise":
        return (
            "Missing numbers: listwise; a participant who misses any measure is left out of all "
            "tests."
        )
    return (
        "Missing numbers: pairwise; a participant who misses a measure in any condition is left "
        "out of the tests of that measure alone."
    )


def sensitivity(found: Sensitivity, protocol: Protocol) -> str:
    """Return what a study of this size can find."""
    of = "d_z" if protocol.design == "within" else "d"
    who = "participants" if protocol.design == "within" else "participants in each group"
    level = (
        f"one test at α = {found.alpha:g}"
        if found.alpha == protocol.alpha
        else f"the strictest step of Holm’s correction, α = {found.alpha:.4g}"
    )
    return (
        f"{found.participants} {who}, {level}: {of} = {decimal(found.t_test)} by a t-test, "
        f"{decimal(found.rank_test)} by ranks."
    )
