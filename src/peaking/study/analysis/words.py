"""Numbers and sentences in APA style (Publication Manual, 7th edition, sections 6.36-6.44).

Two decimals; p with three and `p < .001`; no zero before the point where 1 cannot be exceeded.
"""

from __future__ import annotations

from peaking.study.analysis.measure_analysis import Description, MeasureAnalysis
from peaking.study.measure_catalogue import Measure
from peaking.study.protocol import Protocol
from peaking.study.statistics.outcome import FISHER, SCORE, Effect, Outcome, Result, Untestable

BOUNDED = ("r_rb", "W", "partial η²", "η²", "ε²")
"""Effects that cannot exceed 1."""

MUCH = 0.05
"""Where a limit of a rank-biserial's two intervals differs by more, both are reported."""

PAPERS_NAMES = {"s_conf": "S-Conf.", "satis": "Satis.", "scene_focus": "Scene Focus"}
ABBREVIATIONS = ("sus", "tlx", "harus")


def short_name(measure: Measure) -> str:
    """Return a name that fits into a figure: `SUS Q4`, `TLX frustration`, `S-Conf.`."""
    if measure.kind != "item":
        return measure.label
    first, _, rest = measure.name.partition("_")
    if first in ABBREVIATIONS and rest:
        question = rest[:1] == "q" and rest[1:].isdigit()
        return f"{first.upper()} {rest.upper() if question else rest.replace('_', ' ')}"
    return PAPERS_NAMES.get(measure.name, measure.name.replace("_", " "))


def decimal(value: float, digits: int = 2) -> str:
    """Return a number with a true minus and never "-0.00"."""
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("-")
    return text.replace("-", "−")


def bounded(value: float, digits: int = 2) -> str:
    """Return a number that cannot exceed 1 without the zero before the point."""
    return (
        decimal(value, digits).replace("0.", ".", 1) if abs(value) < 1 else decimal(value, digits)
    )


def p_value(p: float) -> str:
    """Return `p = .023` or `p < .001`."""
    return "p < .001" if p < 0.001 else f"p = {bounded(p, 3)}"


def stars(p: float | None) -> str:
    """Return the usual marks: * below .05, ** below .01, *** below .001."""
    if p is None:
        return ""
    return "***" if p < 0.001 else "**" if p < 0.01 else "*" if p < 0.05 else ""


def statistic(result: Result) -> str:
    """Return the statistic with its degrees of freedom: `t(19) = −2.31`, `V = 12.5`."""
    df = ", ".join(f"{d:.0f}" if abs(d - round(d)) < 1e-9 else decimal(d) for d in result.df)
    value = f"{result.statistic:g}" if result.symbol in ("V", "U") else decimal(result.statistic)
    if result.symbol == "χ²":
        df += f", N = {result.n}"
    return f"{result.symbol}({df}) = {value}" if df else f"{result.symbol} = {value}"


def effect(found: Effect) -> str:
    """Return an effect with its interval: `d_av = −0.59, 95 % CI [−1.02, −0.17]`."""
    write = bounded if found.symbol in BOUNDED else decimal
    value = f"{found.symbol} = {write(found.value)}"
    return f"{value}, {interval(found)}"


def reported(result: Result) -> str:
    """Return the effect that goes with a test; of a rank-biserial it says by what its interval is.

    `r_rb = .91, 95% CI [.78, .97] (Fisher’s z; score interval [.45, .98])`, the latter where the
    two differ by more than `MUCH`.
    """
    first = result.effects[0]
    if first.method != FISHER:
        return effect(first)
    beside = score_interval(result)
    return f"{effect(first)} (Fisher’s z{f'; {beside}' if beside else ''})"


def score_interval(result: Result) -> str:
    """Return `score interval [low, high]` where it is reported too, else nothing."""
    score = differing_interval(result)
    return "" if score is None else f"score interval {_limits(score)}"


def differing_interval(result: Result) -> Effect | None:
    """Return the rank-biserial with its score interval, if that differs much from Fisher's z."""
    first = result.effects[0]
    score = next((e for e in result.effects if e.method == SCORE), None)
    if score is None or first.method != FISHER:
        return None
    pairs = ((first.low, score.low), (first.high, score.high))
    differ = any(a is not None and b is not None and abs(a - b) > MUCH for a, b in pairs)
    return score if differ else None


def interval(found: Effect) -> str:
    """Return `95 % CI [low, high]`, or why there is none."""
    limits = _limits(found)
    return f"95% CI {limits}" if limits else found.method


def _limits(found: Effect) -> str:
    """Return `[low, high]`; nothing where there is no interval."""
    write = bounded if found.symbol in BOUNDED else decimal
    if found.low is None or found.high is None:
        return ""
    return f"[{write(found.low)}, {write(found.high)}]"


def sentence(analysis: MeasureAnalysis, protocol: Protocol) -> str:
    """Return the result of a measure as a sentence for a paper."""
    label, outcome = analysis.measure.label, analysis.decision.outcome
    name = f"“{label}” ({analysis.measure.name})" if analysis.measure.kind == "item" else label
    if isinstance(outcome, Untestable):
        return f"{name}: not tested ({outcome.reason})."
    if len(analysis.described) > 2:
        said = _omnibus(name, analysis, outcome, protocol)
        found = (analysis.p_decisive or 0.0) < protocol.alpha
        return " ".join([said, *_pairs(analysis)]) if found else said
    return _two(name, analysis, outcome, protocol)


def _two(name: str, analysis: MeasureAnalysis, outcome: Result, protocol: Protocol) -> str:
    first, second = analysis.described
    labels = [protocol.condition(d.condition).label for d in (first, second)]
    write = _mean if analysis.decision.parametric else _median
    shown = [f"{label} ({write(d)})" for label, d in zip(labels, (first, second), strict=True)]
    significant = (analysis.p_decisive or 0.0) < protocol.alpha
    figures = (
        f"{outcome.test}, {statistic(outcome)}, {p_value(outcome.p)}{_holm(analysis)}, "
        f"{reported(outcome)}"
    )
    if not significant:
        return f"{name}: no significant difference between {shown[0]} and {shown[1]}; {figures}."
    direction = "higher" if outcome.effects[0].value > 0 else "lower"
    return f"{name}: {direction} with {shown[0]} than with {shown[1]}; {figures}."


def _omnibus(name: str, analysis: MeasureAnalysis, outcome: Result, protocol: Protocol) -> str:
    write = _mean if analysis.decision.parametric else _median
    shown = ", ".join(
        f"{protocol.condition(d.condition).label} ({write(d)})" for d in analysis.described
    )
    significant = (analysis.p_decisive or 0.0) < protocol.alpha
    verb = "significant" if significant else "no significant"
    return (
        f"{name}: {verb} differences between {shown}; {outcome.test}, {statistic(outcome)}, "
        f"{p_value(outcome.p)}{_holm(analysis)}, {reported(outcome)}."
    )


def _pairs(analysis: MeasureAnalysis) -> list[str]:
    said: list[str] = []
    for pair in analysis.decision.pairs:
        if isinstance(pair.outcome, Untestable) or pair.p_holm is None:
            continue
        said.append(
            f"{pair.first} and {pair.second}: {statistic(pair.outcome)}, "
            f"{p_value(pair.p_holm)} (Holm, {p_value(pair.outcome.p)} uncorrected), "
            f"{reported(pair.outcome)}."
        )
    return said


def other_test(outcome: Outcome) -> str:
    """Return the result of the test that was not chosen."""
    if isinstance(outcome, Untestable):
        return f"{outcome.test}: {outcome.reason}"
    return f"{outcome.test}: {statistic(outcome)}, {p_value(outcome.p)}, {reported(outcome)}"


def _holm(analysis: MeasureAnalysis) -> str:
    if not analysis.corrected:
        return " (exploratory, not corrected)"
    said = ", ".join(
        f"{p_value(c.p)} after Holm’s correction of {c.tests} tests ({c.family})"
        for c in analysis.corrected
    )
    return f" ({said})"


def _mean(described: Description) -> str:
    if described.mean is None:
        return "no data"
    spread = "" if described.sd is None else f", SD = {decimal(described.sd)}"
    return f"M = {decimal(described.mean)}{spread}"


def _median(described: Description) -> str:
    if described.median is None or described.quartiles is None:
        return "no data"
    low, high = described.quartiles
    return f"Mdn = {decimal(described.median)}, IQR {decimal(low)}–{decimal(high)}"
