"""A diagnosis as one self-contained HTML page: verdict, findings, proof, and what could not be judged."""

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from discrepancy.evidence import Evidence
from discrepancy.findings import Estimate, Finding, Findings
from discrepancy.quantities import figures, quantity
from discrepancy.units import shown as shown_unit
from discrepancy.words import (
    by_reason,
    counted,
    expected_difference,
    likelihood,
    most_improved,
    noticed,
    number_and_unit,
    told_missing,
    told_verdict,
)
from hil.diagnose.page import drawn, machine
from hil.diagnose.page.mathml import mathml
from hil.diagnose.page.profile import profile
from hil.diagnose.page.tables import Cell, definitions, meter, plain, table
from hil.diagnose.page.told import (
    better,
    lead,
    open_cards,
    percent,
    sentence,
    summary,
    told_kind,
    told_where,
)
from hil.report.document import bar, document, resource

CARD = {"explained": "good", "nothing missing": "good", "unknown": "warned", "inconclusive": "unknown"}
SHOWN_CARDS = 4
COMMAND = re.compile("`([^`]*)`")
OPTION = re.compile(r"(?<!\S)(--\S+)")
CHANNELS_ON_A_CARD = 4


def page(
    result: Findings, shown: Evidence | None, steps: Sequence[str], conditions: Mapping[str, str]
) -> str:
    """The whole document; shown: None where nothing was usable; steps: what to do next; conditions: what was run, as told to the reader."""
    clock = drawn.Clock.of(shown) if shown else None
    chapters = [
        ("next", "What to do next", _steps(steps)),
        ("found", "What was found", "".join(_findings(result))),
        ("machine", "On the machine", machine.chapter(result, shown) if shown else ""),
        ("map", "Where model and recordings differ", drawn.mismatch(shown, clock) if shown and clock else ""),
        ("traces", "Simulated against recorded", drawn.traces(shown, clock) if shown and clock else ""),
        ("residuals", "What is left", drawn.residuals(shown, result.noise) if shown else ""),
        ("candidates", "All candidates", _candidates(result)),
        ("blind", "What was ruled out, and what could not be judged", _blind(result)),
        ("nuisances", "What the baseline absorbed", _nuisances(result)),
        ("recordings", "The recordings", _recordings(result, shown)),
        ("conditions", "What was run", definitions(conditions)),
        ("terms", "Terms", _TERMS),
    ]
    head = (
        f'<h1>{escape(_heading(result))}</h1><p class="soft">model {escape(result.model)} · '
        f"{escape(', '.join(result.recordings))}</p>"
        f'<p class="lead">{escape(lead(result))}</p>{_cards(result)}'
    )
    return document(
        title=f"{result.model}: {result.status}",
        kicker="loaderhil diagnosis",
        head=head,
        chapters=chapters,
        footer="Written by loaderhil. Held-out: predicted with parameters from other stretches than the one shown.",
        aside=bar(),
        style=resource("hil.diagnose.page", "page.css"),
    )


def _heading(result: Findings) -> str:
    if result.named:
        return f"Left out: {', '.join(result.named)}"
    return {
        "unknown": "Something is missing; its cause is unknown",
        "nothing missing": "Nothing is missing",
        "inconclusive": "These recordings cannot tell",
    }.get(result.status, result.status)


def _cards(result: Findings) -> str:
    cards = [_card(CARD[result.status], "verdict", result.status.capitalize(), summary(result))]
    for finding in result.findings[:SHOWN_CARDS]:
        kind = "good" if finding.named else "warned"
        what = told_kind(finding)
        name = finding.effect if finding.named else f"Best proxy: {finding.effect}"
        best, others = most_improved(
            {c: r for c, r in finding.held_out_error.items() if r < 0.995}, CHANNELS_ON_A_CARD
        )
        lower = ", ".join(f"{c} {percent(1 - r)}" for c, r in best.items())
        size = number_and_unit(finding.parameters[0]) if len(finding.parameters) <= 3 else ""
        more = f", and in {others} more channels" if others else ""
        told = f"Held-out error lower by: {lower}{more}." if lower else ""
        cards.append(_card(kind, what, name, f"{size}{'. ' if size else ''}{told}"))
    return f'<div class="cards">{"".join(cards)}</div>'


def _card(kind: str, over: str, outcome: str, story: str) -> str:
    return (
        f'<div class="card {kind}"><p class="run">{escape(over)}</p><p class="outcome">{escape(outcome)}</p>'
        f"<p>{escape(story)}</p></div>"
    )


def _findings(result: Findings) -> Iterator[str]:
    for number, finding in enumerate(result.findings, start=1):
        yield _finding(number, finding)
    if result.open_ended is not None:
        yield from open_cards(result.open_ended)
    if not result.findings and result.open_ended is None:
        yield f"<ul>{''.join(f'<li>{escape(reason)}</li>' for reason in result.reasons)}</ul>"


def _finding(number: int, f: Finding) -> str:
    name = f.effect if f.named else f"best proxy {f.effect}, cause unknown"
    facts = {
        "size": "; ".join(number_and_unit(e) for e in f.parameters[:4])
        + (f"; and {len(f.parameters) - 4} more" if len(f.parameters) > 4 else ""),
        "where": told_where(f.where),
        "on held-out data": f"{better(f.held_out_error)}; closes {percent(f.gap_closed)} of the gap to what is possible",
        "evidence": f"{likelihood(f.gain)}, needed {f.needed:.0f}; {likelihood(f.held_out_gain)} on held-out data; "
        f"{percent(f.absorbed)} of the effect could hide behind the baseline's parameters",
        "not named because": "; ".join(f.doubts),
        "cannot be told from": "; ".join(
            f"{m.effect} ({', '.join(number_and_unit(e) for e in m.parameters[:2])}; likelihood difference {m.likelihood_difference:.1f})"
            for m in f.group
        ),
        "to tell them apart": "; ".join(
            f"from {s.effect}: {s.manoeuvre}" + expected_difference(s) for s in f.separate_by
        ),
    }
    return (
        f'<article class="finding {"named" if f.named else "proxy"}"><h3>{number}. {escape(name)}'
        f"<small>{escape(told_kind(f))}</small></h3><p>{escape(sentence(f.sentence))}</p>"
        f"{mathml(f.equation) if f.equation else ''}{profile(f.parameters)}"
        f"{definitions({k: v for k, v in facts.items() if v})}</article>"
    )


def _steps(steps: Sequence[str]) -> str:
    """A list; what stands between backticks is a command."""

    def code(found: re.Match[str]) -> str:
        words = OPTION.sub(r"<span>\1</span>", found[1])
        return f"<code>{words}</code>"

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
        "noticed from",
        "power",
        "hidden by baseline",
        "why",
    )
    rows: list[Sequence[Cell]] = [
        (
            plain(c.effect),
            plain(c.kind),
            plain(
                told_verdict(c, result),
                "found"
                if c.effect in result.named
                else "blind"
                if c.verdict.startswith("could") or c.verdict == "found"
                else "",
            ),
            plain(f"{c.statistic:.1f}", "n"),
            plain("–" if c.verdict == "could not be judged" else _expected(c.expected)),
            plain(noticed(c)),
            meter(c.power),
            meter(c.absorbed),
            plain(c.reason),
        )
        for c in result.candidates
    ]
    note = (
        "The likeliest first. Score: how much each would lower the squared whitened error of the baseline by itself. Noticed from: the size that these "
        "recordings would show four times in five. Power: the chance to notice one of typical size."
    )
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(3,))}'


def _expected(values: Sequence[Estimate]) -> str:
    if not values or len(values) > 3:
        return f"{len(values)} values" if values else "–"
    return ", ".join(quantity(e.value, e.unit) for e in values)


def _blind(result: Findings) -> str:
    told = [f"{reason}: {', '.join(effects)}" for reason, effects in by_reason(result).items()]
    told += [told_missing(m) for m in result.missing_channels]
    items = "".join(f"<li>{escape(line)}</li>" for line in told)
    return f'<ul class="problems">{items}</ul>' if items else ""


def _nuisances(result: Findings) -> str:
    if not result.nuisances:
        return ""
    head = ("parameter", "unit", "assumed", "now", "± (95 %)", "moved")
    rows: list[Sequence[Cell]] = []
    for n in result.nuisances:
        moved = n.after - n.before
        told = (
            f"{abs(moved) / n.prior_sd:.1f} of its prior's standard deviations"
            if n.prior_sd
            else f"by {figures(moved)}, no prior"
        )
        values = (figures(n.before, 4), figures(n.after, 4), figures(1.96 * n.sd, 2))
        rows.append(
            (
                plain(n.name),
                plain(shown_unit(n.unit)),
                *(plain(v, "n") for v in values),
                plain(told),
            )
        )
    note = "Parameters of the baseline that are not exactly known are refitted in every comparison, within their priors."
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(2, 3, 4))}'


def _recordings(result: Findings, shown: Evidence | None) -> str:
    told = "".join(
        f"<li><b>{escape(c.recording)}</b> {escape(f'{c.signal} {c.text}'.strip())}</li>"
        for c in result.complaints
    )
    extent = f"{counted(len(result.recordings), 'recording')}, {result.samples} samples, {result.simulations} simulations."
    listed = drawn.recordings(shown) if shown else ""
    return f"<p>{extent}</p>{listed}{f'<ul class=problems>{told}</ul>' if told else ''}"


_TERMS = definitions(
    {
        "explained": "at least one effect passed every test; what remains, if anything, is said",
        "unknown": "something depends on known signals or an effect helps, but no name passed the tests",
        "nothing missing": "no effect of the library and no function of the known signals improves held-out prediction",
        "inconclusive": "the recordings are unusable, too short, or would not have shown any effect of the library",
        "before, after": "the baseline alone, and with all effects found; parameters from other stretches than the one shown",
        "one-step error": "what noise leaves of the difference, given the differences before it; residuals are counted in it",
        "best proxy": "an effect that improves prediction and yet is not the cause: it leaves more of the gap than it closes, stops at a "
        "bound, or loses its size beside an equation that does as well",
        "gap": "from the baseline's held-out error to the best that the library or a function of the known signals achieves",
        "interval": "95 %; local, of the parameters with all others refitted",
    }
)
