"""The rounds of an experiment for readers: lines on the terminal, experiment.json, experiment.html."""

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from diagnosis.describe import evidence
from diagnosis.experiment.choosing import Expected, Outlook
from diagnosis.experiment.rounds import Round
from diagnosis.page.tables import Cell, definitions, meter, plain, table
from discrepancy.signals.findings import Findings
from report.kit.document import document

VERSION: Final = 1
"""Of the content of experiment.json."""


def verdict(findings: Findings) -> str:
    """'explained: lateral_relaxation, or yaw_inertia'."""
    named = [" or ".join(f.members) for f in findings.findings if f.named]
    return f"{findings.status}{': ' if named else ''}{'; '.join(named)}"


def lines(done: Round) -> Iterator[str]:
    """A round on the terminal."""
    recordings = ", ".join(done.findings.recordings)
    yield f"Round {done.number}: {recordings}"
    yield f"  {verdict(done.findings)}"
    for group in done.groups:
        yield f"  these recordings cannot distinguish: {', '.join(group)}"
    if done.outlooks:
        yield "     manoeuvre                 time  expected evidence"
    for o in sorted(done.outlooks, key=lambda o: -o.worth):
        mark = "->" if o.manoeuvre.name == done.chosen else "  "
        yield f"  {mark} {o.manoeuvre.name:<24} {o.manoeuvre.duration_s:5.0f} s  {_expected(o)}"
    yield f"  {outcome(done)}"


def outcome(done: Round) -> str:
    """What became of a round, as one sentence."""
    chosen = next((o for o in done.outlooks if o.manoeuvre.name == done.chosen), None)
    if done.outcome == "proposed" and chosen is not None:
        where = f" The scenario: {done.scenario}." if done.scenario is not None else ""
        return f"Next, record {done.chosen}: {chosen.manoeuvre.sentence}{where}"
    if done.outcome == "driven":
        return f"Driven: {done.chosen}, recorded as {done.recording}."
    if done.outcome == "not driven" and chosen is not None:
        return f"{done.chosen} could not be driven: {chosen.reason}"
    if done.outcome == "nothing decides":
        return "No manoeuvre of the list would distinguish them. Another channel may: see the missing channels of the diagnosis."
    if done.resolved:
        return "Every finding has one name."
    if not done.findings.findings:
        return "There is no finding, so there is nothing to distinguish."
    return "Nothing is left that another manoeuvre could distinguish; not every finding has a name."


def _expected(o: Outlook) -> str:
    """'rolling_resistance against brake_drag: 236'."""
    if o.reason:
        return f"not compared: {o.reason}"
    return "; ".join(
        f"{e.one} against {e.other}: {evidence(e.difference)}{'' if e.decides else ' (too little)'}"
        for e in o.expected
    )


def to_json(found: Sequence[Round]) -> str:
    """The text of experiment.json."""
    return json.dumps({"version": VERSION, "rounds": [_plain(r) for r in found]}, indent=2) + "\n"


def _plain(done: Round) -> dict[str, Any]:
    return {
        "round": done.number,
        "recordings": done.findings.recordings,
        "status": done.findings.status,
        "findings": [
            {"effect": f.effect, "named": f.named, "group": [m.effect for m in f.group]}
            for f in done.findings.findings
        ],
        "groups": [list(group) for group in done.groups],
        "manoeuvres": [
            {
                "name": o.manoeuvre.name,
                "duration_s": o.manoeuvre.duration_s,
                "worth": o.worth,
                "expected": [_pair(e) for e in o.expected],
                "not_compared": o.reason or None,
            }
            for o in done.outlooks
        ],
        "chosen": done.chosen or None,
        "scenario": _name(done.scenario),
        "recording": _name(done.recording),
        "outcome": done.outcome,
        "resolved": done.resolved,
    }


def _pair(e: Expected) -> dict[str, Any]:
    return {"one": e.one, "other": e.other, "difference": e.difference, "decides": e.decides}


def _name(path: Path | None) -> str | None:
    return str(path) if path is not None else None


def page(found: Sequence[Round], conditions: Mapping[str, str]) -> str:
    """The text of experiment.html; every round has its own report beside it."""
    last = found[-1]
    head = (
        f"<h1>{escape(verdict(last.findings))}</h1>"
        f'<p class="soft">model {escape(last.findings.model)} · {escape(", ".join(last.findings.recordings))}</p>'
        f'<p class="lead">{escape(outcome(last))}</p>'
    )
    chapters = [(f"round-{r.number}", _heading(r), _chapter(r)) for r in found]
    return document(
        title="Which manoeuvre distinguishes them",
        kicker="loaderhil experiment",
        head=head,
        chapters=[
            *chapters,
            ("conditions", "Command and versions", definitions(conditions)),
            ("terms", "Terms", _TERMS),
        ],
        footer="Written by loaderhil.",
        style=".chosen td { font-weight: 600; }",
    )


def _heading(done: Round) -> str:
    return "The given recordings" if done.number == 0 else f"With manoeuvre {done.number}"


def _chapter(done: Round) -> str:
    report = f"round-{done.number}/report.html"
    parts = [
        f'<p>{escape(verdict(done.findings))}. <a href="{report}">The diagnosis of this round</a>.</p>',
        *(f"<p>These recordings cannot distinguish {escape(', '.join(group))}.</p>" for group in done.groups),
    ]
    if done.outlooks:
        head = ["manoeuvre", "duration", "worth", "expected evidence"]
        ranked = sorted(done.outlooks, key=lambda o: -o.worth)
        parts.append(table(head, [_row(o, done) for o in ranked], numbers=[1, 2]))
    return "".join([*parts, f"<p><strong>{escape(outcome(done))}</strong></p>"])


def _row(o: Outlook, done: Round) -> list[Cell]:
    name = f"{o.manoeuvre.name} (chosen)" if o.manoeuvre.name == done.chosen else o.manoeuvre.name
    return [
        Cell(f'{escape(name)}<br><span class="soft">{escape(o.manoeuvre.sentence)}</span>'),
        plain(f"{o.manoeuvre.duration_s:.0f} s", "n"),
        meter(o.worth) if not o.reason else plain("–", "n"),
        plain(_expected(o)),
    ]


_TERMS: Final = (
    "<p>Expected evidence: twice the logarithm of the likelihood ratio of the two explanations in a recording of the manoeuvre, if one of them "
    "is right. The other one is fitted to it first, as far as the present recordings allow. From 20 on it counts as enough.</p>"
    "<p>Worth: from 0 %, the manoeuvre distinguishes nothing, to 100 %: it distinguishes every pair beyond doubt. Manoeuvres are compared from the "
    "shortest to the longest; the search ends with the first that is worth 100 %.</p>"
)
