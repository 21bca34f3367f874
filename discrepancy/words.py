"""Findings in plain words for the terminal."""

import math
from collections.abc import Iterator, Mapping

from rich.console import Console
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from discrepancy.findings import Candidate, Estimate, Finding, Findings, MissingChannel, Separation
from discrepancy.units import shown

SURE = 1000  # likelihood difference above which its size says nothing more
UNCHANGED = 0.005  # of an error
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
        for line in _reasons(result):
            console.print(escape(line), highlight=False)
    strained = [n for n in result.nuisances if n.prior_sd and abs(n.after - n.before) > 2.0 * n.prior_sd]
    for n in strained:
        away = abs(n.after - n.before) / (n.prior_sd or 1.0)
        text = f"Baseline parameter {n.name} moved to {n.after:.4g} {n.unit}, {away:.1f} standard deviations of its prior"
        console.print(escape(text), highlight=False)
    console.print(f"{result.samples} samples, {result.simulations} simulations", highlight=False)


def number_and_unit(e: Estimate) -> str:
    """'leak = 0.0970 1/s (95 %: 0.0950 to 0.0980), 0.0800 in the baseline', with as many digits as the interval leaves."""
    if e.low is None or e.high is None:
        text = f"{e.name} = {e.value:.4g} {shown(e.unit)}".rstrip()
    else:
        value, low, high = (rounded(v, 0.5 * (e.high - e.low)) for v in (e.value, e.low, e.high))
        text = f"{e.name} = {value} {shown(e.unit)}".rstrip() + f" (95 %: {low} to {high})"
    if e.baseline:
        text += f", {e.baseline:.4g} in the baseline"
    return text + (f", at its {e.at_bound} bound" if e.at_bound else "")


def expected_difference(way: Separation) -> str:
    """' (expected difference 37)', of which 6 would do; empty where it was not computed."""
    if way.expected_difference is None:
        return ""
    large = way.expected_difference >= SURE
    return f" (expected difference {f'over {SURE}' if large else f'{way.expected_difference:.0f}'})"


def counted(number: int, what: str) -> str:
    """'1 recording', '2 recordings'."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def rounded(value: float, uncertainty: float) -> str:
    """To two digits of what is uncertain of it: 0.09619 ± 0.0027 is '0.0962'."""
    if not uncertainty > 0.0:
        return f"{value:.4g}"
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
    unit = shown(missing.unit)
    judged = [f"{w.what} ({f'{w.change:.2g} {unit}'.strip()})" for w in missing.would_judge[:5]]
    parted = [f"{w.what} ({f'{w.change:.2g} {unit}'.strip()})" for w in missing.would_part[:5]]
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
        unit = shown(f.parameters[0].unit)
        lines.append(f"   ... {len(sizes)} values from {min(sizes):.3g} to {max(sizes):.3g} {unit}".rstrip())
    changed = {c: ratio for c, ratio in f.held_out_error.items() if abs(ratio - 1.0) >= UNCHANGED}
    best, others = most_improved(changed, SHOWN_CHANNELS)
    better = (
        ", ".join(f"{c} error x {ratio:.2f}" for c, ratio in best.items()) or "no channel's error changes"
    )
    more = f", and {others} more channels" if others else ""
    lines.append(
        f"   on held-out data: {better}{more}; closes {f.gap_closed:.0%} of the gap to what is possible"
    )
    lines += [f"   doubt: {doubt}" for doubt in f.doubts]
    lines.append(f"   evidence {f.gain:.0f} ({f.needed:.0f} needed), {_where(f)}")
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
    lines = [f"Outside the library: {found.equation}"]
    for term in found.terms:
        size = Estimate(
            name="coefficient", value=term.coefficient, low=term.low, high=term.high, unit=term.unit
        )
        lines.append(f"   {number_and_unit(size)}")
        if term.equally_good:
            lines.append(f"   as good on these data: {'; '.join(term.equally_good[:3])}")
    return "\n".join(lines)


def _ranking(result: Findings, everything: bool) -> Table:
    title = (
        "The library, by what each effect would explain by itself (score). Power: the chance to notice one of typical size. "
        "Hidden: the share of it that the baseline's own parameters could do."
    )
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 1), pad_edge=False)
    for column in ("effect", "verdict", "score", "power", "hidden"):
        table.add_column(column, justify="left" if column in ("effect", "verdict") else "right")
    rows = result.candidates if everything else result.candidates[:12]
    for c in rows:
        table.add_row(
            escape(c.effect),
            told_verdict(c, result),
            f"{c.statistic:.1f}",
            f"{c.power:.0%}",
            f"{c.absorbed:.0%}",
        )
    if len(rows) < len(result.candidates):
        table.caption, table.caption_justify = f"and {len(result.candidates) - len(rows)} more: --all", "left"
    return table


def told_verdict(c: Candidate, result: Findings) -> str:
    """The verdict on a candidate; what was found and is not the cause is a proxy."""
    proxy = c.verdict == "found" and c.effect not in result.named
    return "best proxy" if proxy else c.verdict


def _reasons(result: Findings) -> Iterator[str]:
    """What each verdict rests on, effects of one reason in one line."""
    ruled_out = [c.effect for c in result.candidates if c.verdict == "ruled out"]
    if ruled_out:
        yield f"Ruled out, a typical one would have been noticed: {', '.join(ruled_out)}"
    by_reason: dict[str, list[str]] = {}
    for c in result.candidates:
        if c.verdict in ("could not be judged", "not needed", "negligible"):
            by_reason.setdefault(f"{c.verdict.capitalize()}, {c.reason}", []).append(c.effect)
    yield from (f"{reason}: {', '.join(effects)}" for reason, effects in by_reason.items())
