"""The result of a diagnosis as one self-contained HTML page, for a reader with a browser and no installation."""

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from diagnosis import describe
from diagnosis.page import drawings as drawn
from diagnosis.page import machine
from diagnosis.page.profile import profile
from diagnosis.page.sentences import (
    better,
    headline,
    kind_and_place,
    open_cards,
    percent,
    sentence,
    still_wrong,
    summary,
    where_over,
    where_text,
)
from diagnosis.page.tables import Cell, definitions, meter, plain, table
from discrepancy.decision.evidence import Evidence
from discrepancy.signals.adequacy import inadequate
from discrepancy.signals.findings import Estimate, Finding, Findings
from discrepancy.signals.quantities import figures, quantity
from discrepancy.signals.units import shown as shown_unit
from report.kit.document import bar, document, resource
from report.kit.mathml import mathml

CARD = {
    "explained": "good",
    "nothing missing": "good",
    "explained in part": "warned",
    "unknown": "warned",
    "inconclusive": "unknown",
}
SHOWN_CARDS = 4  # findings with a card of their own; all of them follow below
COMMAND = re.compile("`([^`]*)`")
OPTION = re.compile(r"(?<!\S)(--\S+)")
CHANNELS_ON_A_CARD = 4
MOST_VALUES = 4  # of an effect's parameters in its facts; a profile is drawn instead


def page(
    result: Findings, shown: Evidence | None, steps: Sequence[str], conditions: Mapping[str, str]
) -> str:
    """The text of the HTML document.

    shown: predictions and residuals, None without a usable recording; steps: next steps; conditions: command, time and versions by name.
    """
    # one scale of time for all drawings, so that a place in one is found in the others
    clock = drawn.Clock.of(shown) if shown else None
    chapters = [
        ("next", "What to do next", _steps(steps)),
        ("adequacy", "How much is still wrong", _adequacy(result)),
        ("found", "What was found", "".join(_findings(result))),
        ("machine", "On the machine", machine.chapter(result, shown) if shown else ""),
        ("map", "Where model and recordings differ", drawn.mismatch(shown, clock) if shown and clock else ""),
        ("traces", "Simulated against recorded", drawn.traces(shown, clock) if shown and clock else ""),
        ("residuals", "Remaining residuals", drawn.residuals(shown, result.noise) if shown else ""),
        ("candidates", "All candidates", _candidates(result)),
        ("blind", "Ruled out, or not judged", _blind(result)),
        ("nuisances", "Parameters of the baseline", _nuisances(result)),
        ("recordings", "The recordings", _recordings(result, shown)),
        ("conditions", "Command and versions", definitions(conditions)),
        ("terms", "Terms", _TERMS),
    ]
    head = (
        f'<h1>{escape(_heading(result))}</h1><p class="soft">model {escape(result.model)} · '
        f"{escape(', '.join(result.recordings))}</p>"
        f'<p class="lead">{escape(headline(result))}</p>{_cards(result)}'
    )
    return document(
        title=f"{result.model}: {result.status}",
        kicker="loaderhil diagnosis",
        head=head,
        chapters=chapters,
        footer="Written by loaderhil. Held-out data: predicted with parameters fitted to the other segments of the recordings.",
        aside=bar(),
        style=resource("diagnosis.page", "page.css"),
    )


def _heading(result: Findings) -> str:
    if result.named:
        part = ", and more" if result.status == "explained in part" else ""
        return f"Left out: {'; '.join(describe.alternatives(f, several=len(result.recordings) > 1) for f in result.findings if f.named)}{part}"
    if result.status.startswith("explained"):
        return f"A value of the baseline is wrong: {'; '.join(describe.wrong_values(result))}"
    if result.cut_short and result.status == "unknown":
        return "The model misses something; the search was cut short"
    if result.cut_short:
        return "The search was cut short"
    return {
        "unknown": "The model misses something; the cause is unknown",
        "nothing missing": "Nothing is missing",
        "inconclusive": "These recordings allow no verdict",
    }.get(result.status, result.status)


def _cards(result: Findings) -> str:
    cards = [_card(CARD[result.status], "verdict", result.status.capitalize(), summary(result))]
    if result.adequacy:
        kind = "warned" if inadequate(result.adequacy) else "good"
        cards.append(_card(kind, "what is left", *still_wrong(result)))
    ranked = sorted(result.findings, key=lambda finding: not finding.named)  # stable: by evidence
    for finding in ranked[:SHOWN_CARDS]:
        kind = "good" if finding.named else "warned"
        what = kind_and_place(finding)
        name = describe.alternatives(finding) if finding.named else f"Best proxy: {finding.effect}"
        best, others = describe.most_improved(
            # an improvement below half a percent would be shown as 0 %
            {c: r for c, r in finding.held_out_error.items() if r < 0.995},
            CHANNELS_ON_A_CARD,
        )
        lower = ", ".join(f"{c} {percent(1 - r)}" for c, r in best.items())
        # a map of many values (a profile of a road, a table) has no single size
        size = describe.estimate(finding.parameters[0]) if len(finding.parameters) <= 3 else ""
        more = f", and in {others} more channels" if others else ""
        improvement = f"Error on held-out data lower by: {lower}{more}." if lower else ""
        cards.append(_card(kind, what, name, f"{size}{'. ' if size else ''}{improvement}"))
    if further := ranked[SHOWN_CARDS:]:
        kind = "good" if any(finding.named for finding in further) else "warned"
        names = "; ".join(f.effect if f.named else f"best proxy: {f.effect}" for f in further)
        cards.append(_card(kind, "below", f"{len(further)} more", names))
    return f'<div class="cards">{"".join(cards)}</div>'


def _card(kind: str, over: str, outcome: str, story: str) -> str:
    return (
        f'<div class="card {kind}"><p class="run">{escape(over)}</p><p class="outcome">{escape(outcome)}</p>'
        f"<p>{escape(story)}</p></div>"
    )


def _findings(result: Findings) -> Iterator[str]:
    if result.reasons:
        yield f"<ul>{''.join(f'<li>{escape(reason)}</li>' for reason in result.reasons)}</ul>"
    for number, finding in enumerate(result.findings, start=1):
        yield _finding(number, finding)
    if result.open_ended is not None:
        yield from open_cards(result.open_ended)


def _finding(number: int, f: Finding) -> str:
    name = f.effect if f.named else f"best proxy: {f.effect}; the cause is unknown"
    facts = {
        "size": "; ".join(describe.estimate(e) for e in f.parameters[:MOST_VALUES])
        + (f"; and {len(f.parameters) - MOST_VALUES} more" if len(f.parameters) > MOST_VALUES else ""),
        "where": where_text(f.where),
        "on held-out data": f"{better(f.held_out_error)}; closes {percent(f.gap_closed)} of the gap to the best prediction found",
        "evidence": f"{describe.evidence(f.sse_reduction)} (threshold {f.threshold:.0f}); on held-out data {describe.evidence(f.held_out_sse_reduction)}; "
        f"the baseline's parameters can imitate {percent(f.confounded_share)} of the effect",
        "not the cause because": "; ".join(f.caveats),
        "or instead": "; ".join(
            f"{m.effect} ({', '.join(describe.estimate(e) for e in m.parameters[:2])}; {describe.between(m)})"
            for m in f.group
        ),
        "to distinguish them": "; ".join(
            f"from {s.effect}, record: {s.manoeuvre}" + describe.expected_evidence(s) for s in f.separate_by
        ),
    }
    return (
        f'<article class="finding {"named" if f.named else "proxy"}"><h3>{number}. {escape(name)}'
        f"<small>{escape(kind_and_place(f))}</small></h3><p>{escape(sentence(f.sentence))}</p>"
        f"{mathml(f.equation) if f.equation else ''}{profile(f.parameters)}"
        f"{definitions({k: v for k, v in facts.items() if v})}</article>"
    )


def _adequacy(result: Findings) -> str:
    """Errors of every channel beside their budgets, and the parts of time and the regimes that are beyond them."""
    if not result.adequacy:
        return ""
    head = ("channel", "one step", "sensor", "source", "simulated", "budget", "of budget", "beyond it")
    rows: list[Sequence[Cell]] = []
    several = len(result.recordings) > 1
    # what is still wrong first, worst first
    for c in sorted(result.adequacy, key=lambda c: (c.adequate, -c.over)):
        over = [where_over(p, several=several) for p in (*c.parts, *c.regimes) if p.over]
        rows.append(
            (
                plain(c.channel),
                plain(describe.errors(c.one_step_before, c.one_step, c.unit), "n"),
                plain(quantity(c.budget, c.unit, 2), "n"),
                plain(c.source),
                plain(describe.errors(c.simulated_before, c.simulated, c.unit), "n"),
                plain(quantity(c.simulated_budget, c.unit, 2), "n"),
                plain(f"{figures(c.over, 2)} times", "n"),
                plain("; ".join(over) or ("" if c.adequate else "throughout")),
            )
        )
    note = (
        f"Root mean square errors{', before and after the findings' if result.findings else ''}. One step: a prediction one sample ahead. Simulated: a whole window from its initial "
        "state. Sensor: what the sensor may be off by; from its sheet, or measured on the recording as a lower bound. Budget of a simulation: the "
        "sensor, and a tenth of the channel's movement for disturbances that nobody measured, unless the model states them."
    )
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(1, 2, 4, 5, 6))}'


def _steps(steps: Sequence[str]) -> str:
    """A list; text between backticks is a command, and its options do not break across lines."""

    def code(found: re.Match[str]) -> str:
        command = OPTION.sub(r"<span>\1</span>", found[1])
        return f"<code>{command}</code>"

    items = "".join(f"<li>{COMMAND.sub(code, escape(step))}</li>" for step in steps)
    return f'<ol class="steps">{items}</ol>' if items else ""


def _candidates(result: Findings) -> str:
    if not result.candidates:
        return ""
    head = (
        "effect",
        "kind",
        "verdict",
        "score",
        "expected size",
        "detectable from",
        "power",
        "imitated by baseline",
        "reason",
    )
    rows: list[Sequence[Cell]] = [
        (
            plain(c.effect),
            plain(c.kind),
            plain(
                describe.verdict(c, result),
                "found"
                if c.effect in result.named
                else "blind"
                if c.verdict.startswith("could") or c.verdict == "found"
                else "",
            ),
            plain(f"{c.statistic:.1f}", "n"),
            plain("–" if c.verdict == "could not be judged" else _expected(c.expected)),
            plain(describe.smallest_detectable(c)),
            meter(c.power),
            meter(c.confounded_share),
            plain(c.reason),
        )
        for c in result.candidates
    ]
    note = (
        "Likeliest first. Score: evidence of the effect alone against the baseline. Detectable from: the size that these recordings show with a "
        "probability of 80 %. Power: probability of detecting a change of typical size. Imitated by baseline: share of the effect that other values "
        "of the baseline's parameters produce as well."
    )
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(3,))}'


def _expected(values: Sequence[Estimate]) -> str:
    if not values or len(values) > 3:
        return f"{len(values)} values" if values else "–"
    return ", ".join(quantity(e.value, e.unit) for e in values)


def _blind(result: Findings) -> str:
    # reason first: one missing manoeuvre often accounts for many effects
    lines = [f"{reason}: {', '.join(effects)}" for reason, effects in describe.by_reason(result).items()]
    lines += [describe.missing_channel(m) for m in result.missing_channels]
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul class="problems">{items}</ul>' if items else ""


def _nuisances(result: Findings) -> str:
    if not result.nuisances:
        return ""
    head = ("parameter", "unit", "assumed", "fitted", "± (95 %)", "moved by")
    rows: list[Sequence[Cell]] = []
    for n in result.nuisances:
        moved = n.after - n.before
        distance = (
            f"{abs(moved) / n.prior_sd:.1f} standard deviations of its prior"
            if n.prior_sd
            else f"{figures(moved)} (no prior)"
        )
        # four figures, because a parameter may move by a fraction of a percent and still by several standard deviations
        values = (figures(n.before, 4), figures(n.after, 4), figures(1.96 * n.sd, 2))
        rows.append(
            (
                plain(n.name),
                plain(shown_unit(n.unit)),
                *(plain(v, "n") for v in values),
                plain(distance),
            )
        )
    note = "Parameters of the baseline that are not exactly known. Every comparison refits them within their priors."
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(2, 3, 4))}'


def _recordings(result: Findings, shown: Evidence | None) -> str:
    complaints = "".join(
        f"<li><b>{escape(c.recording)}</b> {escape(f'{c.signal} {c.text}'.strip())}</li>"
        for c in result.complaints
    )
    extent = f"{describe.counted(len(result.recordings), 'recording')}, {result.samples} samples, {result.simulations} simulations."
    listed = drawn.recordings(shown) if shown else ""
    return f"<p>{extent}</p>{listed}{f'<ul class=problems>{complaints}</ul>' if complaints else ''}"


_TERMS = definitions(
    {
        "explained": "at least one effect passed every test, or a value of the baseline is wrong for certain, and the errors of all channels are within their budgets and about those of readings, or of disturbances that the model states",
        "explained in part": "at least one effect passed every test, and something is left that has no name: how much and where is stated",
        "unknown": "model and recordings differ, and no effect of the library passed the tests of a cause",
        "nothing missing": "no effect of the library and no function of the known signals improves the prediction of held-out data, and the errors of all channels are within their budgets",
        "error budget": "what the sensor of a channel may be off by (its sheet, its resolution, its scatter at standstill, or the first differences of the error), and for a simulation what unmeasured disturbances may add",
        "inconclusive": "the recordings are unusable or too short, or no effect of the library would show in them",
        "before, after": "the baseline alone, and with all effects found; parameters are fitted to the other segments of the recordings",
        "one-step error": "standard deviation of the error of a prediction one sample ahead, given all earlier errors; the unit in which residuals are shown",
        "evidence": "twice the logarithm of the likelihood ratio of two fits; the threshold is the value that chance exceeds too rarely to matter",
        "best proxy": "an effect that improves the prediction and is not the cause: it leaves more of the gap than it closes, its value is at a "
        "physical bound, or an equation of known signals does as well",
        "gap": "difference of the baseline's error on held-out data to the smallest error that the library or a function of the known signals reaches; another law that was not tried may do better",
        "interval": "95 % confidence, with all other parameters refitted; by linearisation at the fitted values",
    }
)
