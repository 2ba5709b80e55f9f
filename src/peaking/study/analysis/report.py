"""report.html: one file that needs no network, for people."""

from __future__ import annotations

import html
from collections.abc import Mapping

from peaking.reports.page import html_page, resource
from peaking.study.analysis import words
from peaking.study.analysis.measure_analysis import Analysis, Description, MeasureAnalysis
from peaking.study.analysis.method_text import method, missing, sensitivity
from peaking.study.protocol import Protocol
from peaking.study.statistics.outcome import Outcome, Untestable

FILES = {
    "results.csv": "Results",
    "long.csv": "Data, long",
    "wide.csv": "Data, wide",
    "codebook.csv": "Codebook",
    "results.txt": "Text",
    "figures/": "Figures",
}
CAPTIONS = {
    "boxes": "Measures by condition. Boxes: quartiles and median; whiskers: within 1.5 "
    "interquartile ranges; diamonds: means; dots: participants, connected across conditions if "
    "they did both. "
    "* p < .05, ** p < .01, *** p < .001, after Holm’s correction where a measure is in a family.",
    "effects": "Effects with 95% confidence intervals. Filled: in a declared family; blue: the "
    "interval does not contain 0. Thin: the score interval of a rank-biserial, if it differs by "
    "more than .05.",
    "likert": "Answers on scales: percentage of participants, centred on the middle answer. "
    "Marks as above.",
    "over_time": "Peaked share during the task: median and quartiles over the trials.",
}

INTERVALS_DIFFER = (
    f"the two intervals of the rank-biserial differ by more than {words.bounded(words.MUCH)}. "
    "R’s effectsize uses Fisher’s z; for strong effects that interval contains the true value less "
    "often than in 95% of studies (r = .98, 20 participants: 44%). The score interval keeps 95%."
)


def report_page(analysis: Analysis, figures: Mapping[str, bytes], *, version: str) -> str:
    """Return the page.

    Args:
        analysis: What was found.
        figures: SVG by name: `boxes`, `effects`, `likert-7` …
        version: Of peaking.
    """
    sections = [
        _header(analysis),
        _numbers(analysis),
        _results(analysis),
        _figures(figures),
        _texts(analysis),
        _paths(analysis),
        _order(analysis),
        _power(analysis),
        _who(analysis),
    ]
    return html_page(
        f"{analysis.protocol.title}: analysis",
        f"{''.join(sections)}<footer>Made by peaking {html.escape(version)}.</footer>\n",
        style=resource("peaking.study.analysis", "report.css"),
    )


def _header(analysis: Analysis) -> str:
    nav = "".join(f'<a href="{name}">{text}</a>' for name, text in FILES.items())
    names = " and ".join(html.escape(c.label) for c in analysis.protocol.conditions)
    return (
        f'<header><div><p class="kind">User study</p><h1>{html.escape(analysis.protocol.title)}'
        f'</h1><p class="note">{names}</p></div><nav>{nav}</nav></header>\n'
    )


def _numbers(analysis: Analysis) -> str:
    protocol = analysis.protocol
    tested = [m for m in analysis.measures if m.families and m.result is not None]
    found = [m for m in tested if (m.p_decisive or 0.0) < protocol.alpha]
    excluded = f"{len(analysis.excluded)} excluded" if analysis.excluded else "none excluded"
    design = "within participants" if protocol.design == "within" else "between participants"
    tiles = [
        (
            "Participants",
            str(len(analysis.participants)),
            f"{excluded}, {protocol.planned_participants} planned",
        ),
        ("Design", str(len(protocol.conditions)) + " conditions", design),
        ("Significant", f"{len(found)} of {len(tested)}", "declared hypotheses, after Holm"),
        ("Level", f"α = {protocol.alpha:g}", f"missing values: {protocol.missing}"),
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{html.escape(value)}<small>{html.escape(note)}</small></dd></div>"
        for name, value, note in tiles
    )
    return f'<dl class="numbers">{cells}</dl>\n'


def _results(analysis: Analysis) -> str:
    protocol = analysis.protocol
    heads = "".join(f'<th scope="col">{html.escape(c.label)}</th>' for c in protocol.conditions)
    columns = 5 + len(protocol.conditions)
    rows: list[str] = []
    for family in protocol.families:
        rows.append(_group(f"{family.name}: corrected together", columns))
        rows += [_row(m, protocol) for m in analysis.measures if family.name in m.families]
    rest = [m for m in analysis.measures if not m.families and any(d.count for d in m.described)]
    if rest:
        rows.append(_group("exploratory: not corrected", columns))
        rows += [_row(m, protocol) for m in rest]
    return (
        '<section><h2>Results</h2><p class="note">Mean ± standard deviation if a t-test or an '
        "ANOVA was used, otherwise median with quartiles. Shaded: declared, and below α after the "
        "correction. Differences and signs of effects: the earlier column minus the later one. "
        "Intervals of rank-biserials are by Fisher’s z; a score interval is added where it differs "
        "by more than .05.</p>"
        f'<div class="wide"><table><thead><tr><th scope="col">Measure</th>{heads}'
        '<th scope="col">Test</th><th scope="col">p</th><th scope="col">p, Holm</th>'
        f'<th scope="col">Effect, 95% CI</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
        "</div></section>\n"
    )


def _group(name: str, columns: int) -> str:
    return (
        f'<tr class="family"><th scope="colgroup" colspan="{columns}">{html.escape(name)}</th></tr>'
    )


def _row(analysis: MeasureAnalysis, protocol: Protocol) -> str:
    outcome = analysis.decision.outcome
    cells = [f'<td class="n">{_described(d, analysis)}</td>' for d in analysis.described]
    if isinstance(outcome, Untestable):
        cells.append(f'<td colspan="4">No test: {html.escape(outcome.reason)}</td>')
        return f'<tr><th scope="row">{_name(analysis)}</th>{"".join(cells)}</tr>'
    size, _, limits = words.effect(outcome.effects[0]).partition(", ")
    beside = words.score_interval(outcome)
    both = [limits, beside] if beside else [limits]
    mark = f' <b class="mark">{words.stars(analysis.p_decisive)}</b>'
    plain = html.escape(words.p_value(outcome.p))
    corrected = "–"
    if analysis.p_corrected is None:
        plain += mark
    else:
        corrected = html.escape(words.p_value(analysis.p_corrected)) + mark
    cells += [
        f'<td class="n">{html.escape(outcome.test.removesuffix(" test"))}'
        f"<small>{html.escape(words.statistic(outcome))}, n = {outcome.n}</small></td>",
        f'<td class="n">{plain}</td>',
        f'<td class="n">{corrected}</td>',
        f'<td class="n">{_symbols(size)}{"".join(f"<small>{html.escape(i)}</small>" for i in both)}'
        "</td>",
    ]
    found = analysis.p_corrected is not None and analysis.p_corrected < protocol.alpha
    row = '<tr class="found">' if found else "<tr>"
    return f'{row}<th scope="row">{_name(analysis)}</th>{"".join(cells)}</tr>'


def _name(analysis: MeasureAnalysis) -> str:
    """Return the short name with, small, what was asked, or the name in the tables."""
    measure = analysis.measure
    unit = f", {measure.unit}" if measure.unit in ("s", "%") else ""
    below = measure.label if measure.kind == "item" else measure.name
    return f"{html.escape(words.short_name(measure) + unit)}<small>{html.escape(below)}</small>"


def _described(described: Description, analysis: MeasureAnalysis) -> str:
    if described.mean is None or described.median is None or described.quartiles is None:
        return "–"
    if analysis.decision.parametric:
        spread = "" if described.sd is None else f" ± {words.decimal(described.sd)}"
        return f"{words.decimal(described.mean)}{spread}"
    low, high = described.quartiles
    quartiles = f"{words.decimal(low)} – {words.decimal(high)}"
    return f"{words.decimal(described.median)}<small>{quartiles}</small>"


def _symbols(text: str) -> str:
    """Set the index of a symbol low."""
    escaped = html.escape(text)
    for symbol, index in (("d_av", "av"), ("d_z", "z"), ("r_rb", "rb")):
        escaped = escaped.replace(symbol, f"<i>{symbol[0]}</i><sub>{index}</sub>")
    return escaped


def _figures(figures: Mapping[str, bytes]) -> str:
    parts: list[str] = []
    for name, svg in figures.items():
        caption = CAPTIONS[name.partition("-")[0]]
        drawing = svg[svg.index(b"<svg") :].decode("utf-8")
        drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{caption}" ', 1)
        # Every drawing numbers its parts from 1; on one page the numbers must differ.
        drawing = _own_ids(drawing, name)
        parts.append(
            f"<figure>{drawing}</figure><figcaption>{html.escape(caption)} "
            f'<a href="figures/{name}.svg">SVG</a>, <a href="figures/{name}.png">PNG</a>'
            "</figcaption>"
        )
    return f"<section><h2>Figures</h2>{''.join(parts)}</section>\n" if parts else ""


def _own_ids(drawing: str, name: str) -> str:
    for before in ('id="', 'xlink:href="#', "url(#"):
        drawing = drawing.replace(before, f"{before}{name}-")
    return drawing


def _texts(analysis: Analysis) -> str:
    protocol = analysis.protocol
    declared = [m for m in analysis.measures if m.families]
    explored = [m for m in analysis.measures if not m.families and m.result is not None]
    parts = [f'<h3>Method</h3><p class="paste">{html.escape(method(analysis))}</p>']
    for heading, measures in (("Declared hypotheses", declared), ("Exploratory", explored)):
        if measures:
            sentences = "".join(
                f'<p class="paste">{html.escape(words.sentence(m, protocol))}</p>' for m in measures
            )
            shown = " open" if heading == "Declared hypotheses" else ""
            parts.append(f"<details{shown}><summary>{heading}</summary>{sentences}</details>")
    return (
        '<section><h2>Text for a paper</h2><p class="note">In APA style; a click selects a '
        f"paragraph.</p>{''.join(parts)}</section>\n"
    )


def _paths(analysis: Analysis) -> str:
    items = "".join(_path(m) for m in analysis.measures if any(d.count for d in m.described))
    return (
        '<section><h2>Decision paths</h2><p class="note">Why each measure was tested as it was, '
        "what the other test says, and who was left out.</p>"
        f"{items}</section>\n"
    )


def _path(analysis: MeasureAnalysis) -> str:
    decision = analysis.decision
    steps = "".join(f"<li>{html.escape(line)}</li>" for line in decision.path())
    more: list[tuple[str, str]] = []
    if not isinstance(decision.outcome, Untestable):
        more += [("Effect", words.effect(e) + f" ({e.method})") for e in decision.outcome.effects]
        if words.differing_interval(decision.outcome) is not None:
            more.append(("Intervals", INTERVALS_DIFFER))
        more += [("Remark", remark) for remark in decision.outcome.remarks]
        more.append(("Not chosen", words.other_test(decision.other)))
    more += [
        (f"{pair.first} − {pair.second}", _pair(pair.outcome, pair.p_holm))
        for pair in decision.pairs
    ]
    if analysis.left_out:
        more.append(("Left out", f"{', '.join(analysis.left_out)}: a value is missing"))
    rows = "".join(f"<dt>{html.escape(a)}</dt><dd>{_symbols(b)}</dd>" for a, b in more)
    chosen = decision.outcome.test if analysis.result is not None else "no test"
    return (
        f"<details><summary><b>{html.escape(words.short_name(analysis.measure))}</b> "
        f"<span>{analysis.measure.name} · {html.escape(chosen)}</span></summary>"
        f'<ol class="path">{steps}</ol><dl class="more">{rows}</dl></details>'
    )


def _pair(outcome: Outcome, p_holm: float | None) -> str:
    if p_holm is None:
        return words.other_test(outcome)
    return f"{words.other_test(outcome)}; after Holm’s correction {words.p_value(p_holm)}"


def _order(analysis: Analysis) -> str:
    with_order = [m for m in analysis.measures if m.order is not None and m.families]
    if not with_order:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{_name(m)}</th>'
        f"<td>{_short(m.order.period)}</td><td>{_short(m.order.carry_over)}</td></tr>"
        for m in with_order
        if m.order is not None
    )
    alpha = analysis.protocol.alpha
    doubtful = [
        m.measure.name
        for m in with_order
        if m.order is not None
        and any(
            not isinstance(o, Untestable) and o.p < alpha
            for o in (m.order.period, m.order.carry_over)
        )
    ]
    said = (
        f"Check {', '.join(doubtful)}: an effect of the order has p < {alpha:g} there."
        if doubtful
        else f"No p-value is below {alpha:g}."
    )
    return (
        '<section><h2>Order effects</h2><p class="note">Period: whether later trials differ from '
        "earlier ones in any condition. Carry-over: whether participants who began with the first "
        "condition differ from the others over both conditions. Not corrected. "
        f"{html.escape(said)}</p>"
        '<div class="wide"><table><thead><tr><th scope="col">Measure</th><th scope="col">Period'
        f'</th><th scope="col">Carry-over</th></tr></thead><tbody>{rows}</tbody></table></div>'
        "</section>\n"
    )


def _short(outcome: Outcome) -> str:
    if isinstance(outcome, Untestable):
        return html.escape(outcome.reason)
    return html.escape(f"{words.statistic(outcome)}, {words.p_value(outcome.p)}")


def _power(analysis: Analysis) -> str:
    parts: list[str] = []
    for heading, found in (("As planned", analysis.planned), ("As done", analysis.reached)):
        if found:
            items = "".join(
                f"<li>{html.escape(sensitivity(s, analysis.protocol))}</li>" for s in found
            )
            parts.append(f"<h3>{heading}</h3><ul>{items}</ul>")
    if not parts:
        return ""
    return (
        '<section><h2>Power</h2><p class="note">The smallest effect that is detected with '
        "80% probability. Power for the observed effect is not shown: it adds nothing to the "
        f"p-value.</p>{''.join(parts)}</section>\n"
    )


def _who(analysis: Analysis) -> str:
    excluded = "".join(
        f"<li>{html.escape(name)}: {html.escape(why)}</li>" for name, why in analysis.excluded
    )
    left = f"<h3>Excluded</h3><ul>{excluded}</ul>" if excluded else "<p>None was excluded.</p>"
    return (
        f"<section><h2>Participants</h2><p>{html.escape(', '.join(analysis.participants))}</p>"
        f'{left}<p class="note">{html.escape(missing(analysis.protocol))}</p></section>\n'
    )
