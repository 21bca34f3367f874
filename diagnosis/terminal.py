"""The result of a diagnosis on the terminal: verdict first, then the findings, then what else was considered."""

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from diagnosis.describe import (
    UNCHANGED,
    alternatives,
    between,
    budget,
    by_reason,
    error_ratio,
    errors,
    estimate,
    evidence,
    expected_evidence,
    missing_channel,
    most_improved,
    only_at,
    remaining,
    share,
    smallest_detectable,
    verdict,
    wrong_values,
)
from discrepancy.signals.findings import Estimate, Finding, Findings
from discrepancy.signals.quantities import figures, quantity, span

MOST_ROWS = 12  # of candidates, without --all
MOST_NAMES = 6  # of effects with the same reason, without --all
MOST_VALUES = 4  # of an effect's parameters; a road profile has hundreds
SHOWN_CHANNELS = 6  # of those that a finding improves
SHARE_SHOWN = 0.05  # of the evidence, below which a channel is not listed
MOVED = 2.0  # standard deviations of its prior, beyond which a baseline parameter is worth a line
COLOUR = {
    "explained": "green",
    "explained in part": "yellow",
    "unknown": "yellow",
    "nothing missing": "green",
    "inconclusive": "red",
}


def render(result: Findings, console: Console, *, all_candidates: bool = False) -> None:
    """Print the whole result; without all_candidates long lists are cut, and the cut is stated."""
    console.print(_headline(result), soft_wrap=False)
    for number, finding in enumerate(result.findings, start=1):
        console.print(escape("\n".join(_finding(number, finding, result))), highlight=False)
    if result.open_ended is not None:
        console.print(escape("\n".join(_open_equation(result))), highlight=False)
    for complaint in [c for c in result.complaints if c.described not in result.reasons]:
        colour = "[red]" if complaint.fatal else "[yellow]"
        console.print(f"{colour}{escape(complaint.described)}[/]", highlight=False)
    for line in _moved_parameters(result):
        console.print(escape(line), highlight=False)
    if result.adequacy:
        console.print()
        console.print(_adequacy(result, all_candidates))
    if result.candidates:
        console.print()
        console.print(_candidates(result, all_candidates))
        for line in _reasons(result, all_candidates):
            console.print(escape(line), highlight=False)
    for missing in result.missing_channels:
        console.print(escape(f"Channel {missing_channel(missing)}"), highlight=False)
    console.print(f"{result.samples} samples, {result.simulations} simulations", highlight=False)


def _headline(result: Findings) -> Panel:
    """The verdict with every named effect and its indistinguishable alternatives, the reasons, and how much is still wrong."""
    colour = COLOUR[result.status]
    several = len(result.recordings) > 1
    causes = [alternatives(f, several=several) for f in result.findings if f.named]
    named = "; ".join([*causes, *wrong_values(result)])
    head = f"[bold {colour}]{result.status}{': ' if named else ''}{escape(named)}[/]\n"
    title = f"{result.model}: {', '.join(result.recordings)}"
    return Panel(
        head + "\n".join(escape(line) for line in [*result.reasons, *remaining(result)]),
        title=escape(title),
        title_align="left",
    )


def _finding(number: int, f: Finding, result: Findings) -> Iterator[str]:
    """One finding: what it is, its size, what it improves, where it shows, and what may be in its place."""
    kind = "sensor" if f.kind == "sensor" else "physics"
    name = f"{f.effect} ({kind})" if f.named else f"best proxy: {f.effect} ({kind}); the cause is unknown"
    yield f"{number}. {name}: {f.sentence}"
    yield f"   equation: {f.equation}   place: {f.place}"
    shown = f.parameters if len(f.parameters) <= MOST_VALUES else f.parameters[: MOST_VALUES - 1]
    yield from (f"   {estimate(e)}" for e in shown)
    if len(f.parameters) > len(shown):
        sizes = [e.value for e in f.parameters]
        ends = f"{figures(min(sizes))} to {quantity(max(sizes), f.parameters[0].unit)}"
        yield f"   ... {len(sizes)} values from {ends}"
    yield f"   held-out data: {_improvement(f)}"
    yield from (f"   not the cause because: {caveat}" for caveat in f.caveats)
    yield f"   evidence: {evidence(f.sse_reduction)} (threshold {f.threshold:.0f}), from {_where(f, several=len(result.recordings) > 1)}"
    for member in f.group:
        values = ", ".join(estimate(e) for e in member.parameters[:2])
        yield f"   or {member.effect}: {values}; {between(member)}"
    for s in f.separate_by:
        yield f"   to distinguish it from {s.effect}, record: {s.manoeuvre}{expected_evidence(s)}"


def _improvement(f: Finding) -> str:
    """'speed error × 0.27, and 3 more channels; 80 % of the error that could be removed'."""
    changed = {c: ratio for c, ratio in f.held_out_error.items() if abs(ratio - 1.0) >= UNCHANGED}
    best, others = most_improved(changed, SHOWN_CHANNELS)
    errors = ", ".join(f"{c} error {error_ratio(ratio)}" for c, ratio in best.items())
    more = f", and {others} more channels" if others else ""
    if not errors:
        return "no error of a channel changes noticeably"
    return f"{errors}{more}; closes {share(f.gap_closed)} of the gap to the best prediction found"


def _where(f: Finding, *, several: bool) -> str:
    """Channels, times and range of a signal where the finding shows; several: times name their recording."""
    channels = ", ".join(f"{c} {s:.0%}" for c, s in f.where.channels.items() if s > SHARE_SHOWN)
    text = f"{channels}"
    if f.where.temporary:
        text += only_at(f.where, several=several)
    elif f.where.throughout:
        text += ", throughout"
    else:
        spans = [
            f"{f'{i.recording} ' if several else ''}{span(i.start_s, i.end_s)} ({i.share:.0%})"
            for i in f.where.intervals[:3]
        ]
        text += f", mostly at {', '.join(spans)}" if spans else ""
    if f.where.regimes:
        text += f", strongest where {f.where.regimes[0].text}"
    return text


def _open_equation(result: Findings) -> Iterator[str]:
    """Terms outside of the library, with their coefficients."""
    found = result.open_ended
    assert found is not None
    yield (
        f"No effect of the library, but an equation of known signals: evidence {evidence(found.sse_reduction)} (threshold {found.threshold:.0f})"
    )
    for i, term in enumerate(found.terms, start=1):
        size = Estimate(name=f"c{i}", value=term.coefficient, low=term.low, high=term.high, unit=term.unit)
        yield f"   {term.place} += c{i} {term.function}".removesuffix(" 1")
        yield f"   {estimate(size)}"
        if term.equally_good:
            yield f"   fits as well: {'; '.join(term.equally_good[:3])}"


def _moved_parameters(result: Findings) -> Iterator[str]:
    """Parameters of the baseline that the data move far from their assumed values."""
    for n in result.nuisances:
        if n.prior_sd and abs(n.after - n.before) > MOVED * n.prior_sd:
            distance = abs(n.after - n.before) / n.prior_sd
            yield (
                f"The baseline's {n.name} is {quantity(n.after, n.unit, 4)} by these recordings; the assumed value is {figures(n.before, 4)}: "
                f"{distance:.1f} standard deviations of its prior"
            )


def _adequacy(result: Findings, everything: bool) -> Table:
    """Errors of every channel beside their budgets, the furthest beyond first."""
    table = Table(
        title="Errors and budgets", title_justify="left", box=None, padding=(0, 2, 0, 1), pad_edge=False
    )
    table.add_column("channel", no_wrap=True)
    for column in ("one step", "sensor", "simulated", "budget"):
        table.add_column(column, justify="right")
    table.add_column("")
    ranked = sorted(result.adequacy, key=lambda c: (c.adequate, -c.over))
    rows = ranked if everything else ranked[:MOST_ROWS]
    for c in rows:
        table.add_row(
            escape(c.channel),
            errors(c.one_step_before, c.one_step, c.unit),
            budget(c),
            errors(c.simulated_before, c.simulated, c.unit),
            quantity(c.simulated_budget, c.unit, 2),
            "" if c.adequate else "[yellow]over[/]",
        )
    cut = f"{len(ranked) - len(rows)} more: --all lists them. " if len(rows) < len(ranked) else ""
    table.caption = (
        f"{cut}One step: error of a prediction one sample ahead, before and after the findings. Sensor: what it may be off by, and from where "
        "that is known. Simulated: error over a window from its initial state. Budget: sensor, and what unmeasured disturbances may add."
    )
    table.caption_justify = "left"
    return table


def _candidates(result: Findings, everything: bool) -> Table:
    """The effects of the library with their verdicts, likeliest first."""
    table = Table(
        title="Effects of the library, likeliest first", title_justify="left", box=None, padding=(0, 2, 0, 1), pad_edge=False
    )  # fmt: skip
    table.add_column("effect", no_wrap=True)
    table.add_column("verdict")
    for column in ("score", "power", "detectable from"):
        table.add_column(column, justify="right")
    rows = result.candidates if everything else result.candidates[:MOST_ROWS]
    for c in rows:
        table.add_row(
            escape(c.effect),
            verdict(c, result),
            evidence(c.statistic) if c.statistic >= 1.0 else f"{c.statistic:.1f}",
            f"{c.power:.0%}",
            smallest_detectable(c),
        )
    cut = (
        f"{len(result.candidates) - len(rows)} more: --all lists them. "
        if len(rows) < len(result.candidates)
        else ""
    )
    table.caption = (
        f"{cut}Score: evidence of the effect alone against the baseline. Power: probability of detecting a change of typical size. "
        "Detectable from: size detected with a probability of 80 %."
    )
    table.caption_justify = "left"
    return table


def _reasons(result: Findings, everything: bool) -> Iterator[str]:
    """The reason of each verdict, with the effects that share it."""
    most = len(result.candidates) if everything else MOST_NAMES
    for reason, effects in by_reason(result).items():
        more = f" and {len(effects) - most} more" if len(effects) > most else ""
        yield f"{reason}: {', '.join(effects[:most])}{more}"
