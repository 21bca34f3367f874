"""Findings in plain words for the terminal."""

import math
from collections.abc import Iterator, Mapping

from rich.console import Console
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from discrepancy.findings import Candidate, Estimate, Finding, Findings, MissingChannel, Separation
from discrepancy.quantities import figures, quantity
from discrepancy.units import shown

SURE = 1000  # likelihood difference above which its size says nothing more
UNCHANGED = 0.005  # of an error
LEAST_TOLD = 0.01  # of an error
MOST_ROWS = 12  # of candidates, unless all are asked for
MOST_DECIMALS = 7  # with more, a power of ten reads better
SHOWN_CHANNELS = 6  # of those that a finding improves; all of them are in findings.json and in the report
COLOUR = {"explained": "green", "unknown": "yellow", "nothing missing": "green", "inconclusive": "red"}


def tell(result: Findings, console: Console, *, all_candidates: bool = False) -> None:
    """Print the verdict, the findings, what else was considered, and what was wrong with the recordings."""
    colour = COLOUR[result.status]
    named = f": {escape(', '.join(result.named))}" if result.named else ""
    head = f"[bold {colour}]{result.status}{named}[/]\n" + "\n".join(
        escape(reason) for reason in result.reasons
    )
    title = f"{result.model}: {', '.join(result.recordings)}"
    console.print(Panel(head, title=escape(title), title_align="left"), soft_wrap=False)
    for number, finding in enumerate(result.findings, start=1):
        console.print(escape(_finding(number, finding)), highlight=False)
    if result.open_ended is not None:
        console.print(escape(_open(result)), highlight=False)
    for missing in result.missing_channels:
        console.print(escape(told_missing(missing)), highlight=False)
    for complaint in [c for c in result.complaints if c.told not in result.reasons]:
        mark = "[red]" if complaint.fatal else "[yellow]"
        console.print(f"{mark}{escape(complaint.told)}[/]", highlight=False)
    if result.candidates:
        console.print(_ranking(result, all_candidates))
        for line in _reasons(result, all_candidates):
            console.print(escape(line), highlight=False)
    strained = [n for n in result.nuisances if n.prior_sd and abs(n.after - n.before) > 2.0 * n.prior_sd]
    for n in strained:
        away = abs(n.after - n.before) / (n.prior_sd or 1.0)
        text = f"Baseline parameter {n.name} moved from {figures(n.before, 4)} to {quantity(n.after, n.unit, 4)}, {away:.1f} standard deviations of its prior"
        console.print(escape(text), highlight=False)
    console.print(f"{result.samples} samples, {result.simulations} simulations", highlight=False)


def number_and_unit(e: Estimate) -> str:
    """'leak = 0.0970 1/s (95 %: 0.0950 to 0.0980), 0.0800 in the baseline', with as many digits as the interval leaves."""
    if e.low is None or e.high is None:
        text = f"{e.name} = {quantity(e.value, e.unit, 4)}"
    else:
        value, low, high = (rounded(v, 0.5 * (e.high - e.low)) for v in (e.value, e.low, e.high))
        text = f"{e.name} = {value} {shown(e.unit)}".rstrip() + f" (95 %: {low} to {high})"
    if e.baseline:
        text += f", {figures(e.baseline, 4)} in the baseline"
    return text + (f", at its {e.at_bound} bound" if e.at_bound else "")


def expected_difference(way: Separation) -> str:
    """' (expected difference 37)', of which 6 would do; empty where it was not computed."""
    if way.expected_difference is None:
        return ""
    return f" (expected difference {likelihood(way.expected_difference)})"


def likelihood(difference: float) -> str:
    """'37'; 'over 1000' where its size says nothing more."""
    return f"over {SURE}" if difference >= SURE else f"{difference:.0f}"


def times(ratio: float) -> str:
    """Of an error to another: '× 0.18', 'below × 0.01'."""
    return f"× {ratio:.2f}" if ratio >= LEAST_TOLD else f"below × {LEAST_TOLD}"


def noticed(c: Candidate, most: int = 2) -> str:
    """From which size on an effect would be noticed: '60 kg', '-0.07 from 1'; a dash where no size would be."""
    sizes = [_away(e) for e in c.noticed_from]
    return ", ".join(sizes[:most]) + (", ..." if len(sizes) > most else "") or "–"


def _away(e: Estimate) -> str:
    """A size, or how far it is from that of the baseline where this is not 0."""
    if not e.baseline:
        return quantity(e.value, e.unit, 2)
    sign = "+" if e.value > e.baseline else ""
    return f"{sign}{quantity(e.value - e.baseline, e.unit, 2)} from {figures(e.baseline)}"


def counted(number: int, what: str) -> str:
    """'1 recording', '2 recordings'."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def rounded(value: float, uncertainty: float) -> str:
    """To two digits of what is uncertain of it: 0.09619 ± 0.0027 is '0.0962'."""
    if not uncertainty > 0.0:
        return figures(value, 4)
    decimals = 1 - math.floor(math.log10(uncertainty))
    if decimals > MOST_DECIMALS:
        return f"{value:.4g}"
    return f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"


def most_improved(error: Mapping[str, float], count: int) -> tuple[dict[str, float], int]:
    """The channels whose error falls most, best first, and how many others there are."""
    ranked = sorted(error.items(), key=lambda item: item[1])
    return dict(ranked[:count]), max(len(ranked) - count, 0)


def told_missing(missing: MissingChannel) -> str:
    """'speed was not recorded; it would have shown linear drag (0.3 m/s), parted gyro delay from servo delay'."""
    judged = [f"{w.what} ({quantity(w.change, missing.unit, 2)})" for w in missing.would_judge[:5]]
    parted = [f"{w.what} ({quantity(w.change, missing.unit, 2)})" for w in missing.would_part[:5]]
    told = [f"shown {', '.join(judged)}"] if judged else []
    told += [f"parted {', '.join(parted)}"] if parted else []
    gone = "could not be used" if missing.recorded else "was not recorded"
    return f"{missing.channel} {gone}; it would have {' and '.join(told) or 'told nothing more'}"


def _finding(number: int, f: Finding) -> str:
    kind = "sensor" if f.kind == "sensor" else "physics"
    name = f"{f.effect} ({kind})" if f.named else f"best proxy {f.effect} ({kind}), cause unknown"
    lines = [f"{number}. {name}: {f.sentence}", f"   {f.equation}   at: {f.place}"]
    first = f.parameters if len(f.parameters) <= 4 else f.parameters[:3]
    lines += [f"   {number_and_unit(e)}" for e in first]
    if len(f.parameters) > len(first):
        sizes = [e.value for e in f.parameters]
        ends = f"{figures(min(sizes))} to {quantity(max(sizes), f.parameters[0].unit)}"
        lines.append(f"   ... {len(sizes)} values from {ends}")
    changed = {c: ratio for c, ratio in f.held_out_error.items() if abs(ratio - 1.0) >= UNCHANGED}
    best, others = most_improved(changed, SHOWN_CHANNELS)
    better = (
        ", ".join(f"{c} error {times(ratio)}" for c, ratio in best.items()) or "no channel's error changes"
    )
    more = f", and {others} more channels" if others else ""
    lines.append(
        f"   on held-out data: {better}{more}; closes {f.gap_closed:.0%} of the gap to what is possible"
    )
    lines += [f"   doubt: {doubt}" for doubt in f.doubts]
    lines.append(f"   evidence {likelihood(f.gain)} ({f.needed:.0f} needed), {_where(f)}")
    for member in f.group:
        values = ", ".join(number_and_unit(e) for e in member.parameters[:2])
        lines.append(
            f"   or: {member.effect}, {values}; likelihood difference {member.likelihood_difference:.1f}"
        )
    for way in f.separate_by:
        lines.append(f"   to tell it from {way.effect}: {way.manoeuvre}{expected_difference(way)}")
    return "\n".join(lines)


def _where(f: Finding) -> str:
    channels = ", ".join(f"{c} {s:.0%}" for c, s in f.where.channels.items() if s > 0.05)
    text = f"seen in {channels}"
    if f.where.throughout:
        text += ", throughout"
    else:
        spans = [f"{i.start_s:.1f}-{i.end_s:.1f} s ({i.share:.0%})" for i in f.where.intervals[:3]]
        text += f", mostly at {', '.join(spans)}" if spans else ""
    if f.where.regimes:
        text += f", strongest where {f.where.regimes[0].text}"
    return text


def _open(result: Findings) -> str:
    found = result.open_ended
    assert found is not None
    lines = [f"Outside the library, with evidence {likelihood(found.gain)} ({found.needed:.0f} needed):"]
    for i, term in enumerate(found.terms, start=1):
        size = Estimate(name=f"c{i}", value=term.coefficient, low=term.low, high=term.high, unit=term.unit)
        lines.append(f"   {term.place} += c{i} {term.function}".removesuffix(" 1"))
        lines.append(f"   {number_and_unit(size)}")
        if term.equally_good:
            lines.append(f"   as good on these data: {'; '.join(term.equally_good[:3])}")
    return "\n".join(lines)


def _ranking(result: Findings, everything: bool) -> Table:
    title = (
        "The library, likeliest first. Score: what each would explain by itself. Power: the chance to notice one of typical size. "
        "Noticed from: the size of which that chance is 80 %."
    )
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 1), pad_edge=False)
    table.add_column("effect", no_wrap=True)
    table.add_column("verdict")
    for column in ("score", "power", "noticed from"):
        table.add_column(column, justify="right")
    rows = result.candidates if everything else result.candidates[:MOST_ROWS]
    for c in rows:
        table.add_row(
            escape(c.effect),
            told_verdict(c, result),
            f"{c.statistic:.1f}",
            f"{c.power:.0%}",
            noticed(c),
        )
    if len(rows) < len(result.candidates):
        table.caption, table.caption_justify = f"and {len(result.candidates) - len(rows)} more: --all", "left"
    return table


def told_verdict(c: Candidate, result: Findings) -> str:
    """The verdict on a candidate; what was found and is not the cause is a proxy."""
    proxy = c.verdict == "found" and c.effect not in result.named
    return "best proxy" if proxy else c.verdict


def _reasons(result: Findings, everything: bool) -> Iterator[str]:
    """What each verdict rests on, effects of one reason in one line."""
    most = len(result.candidates) if everything else MOST_ROWS
    for reason, effects in by_reason(result).items():
        more = f" and {len(effects) - most} more: --all" if len(effects) > most else ""
        yield f"{reason}: {', '.join(effects[:most])}{more}"


def by_reason(result: Findings) -> dict[str, list[str]]:
    """Effects that were not found, by verdict and reason: first what was ruled out, last what could not be judged."""
    found: dict[str, list[str]] = {}
    for verdict in ("ruled out", "not needed", "negligible", "could not be judged"):
        for c in [c for c in result.candidates if c.verdict == verdict]:
            found.setdefault(f"{verdict.capitalize()}, {c.reason}", []).append(c.effect)
    return found
