"""Descriptions of estimates, candidates and missing channels in plain English, for the terminal and the HTML page alike."""

import math
from collections.abc import Mapping

from discrepancy import gates
from discrepancy.signals.adequacy import OVER_SHOWN, STILL_WRONG, ChannelAdequacy, inadequate, left
from discrepancy.signals.findings import (
    Candidate,
    Estimate,
    Finding,
    Findings,
    GroupMember,
    MissingChannel,
    Separation,
    Where,
)
from discrepancy.signals.quantities import figures, quantity, readable, span
from discrepancy.signals.units import shown

SURE = 1000  # evidence above which its exact number is meaningless: the noise model is never that exact
UNCHANGED = 0.005  # relative change of an error that is not worth a line
SMALLEST_RATIO = 0.01  # of two errors; a smaller one is given as a bound
MOST_DECIMALS = 7  # with more, a power of ten reads better
MOST_EFFECTS = 5  # of a missing channel; all of them are in findings.json


def estimate(e: Estimate) -> str:
    """'leak = 0.0970 1/s (95 %: 0.0950 to 0.0980), baseline 0.0800', with as many digits as the interval supports."""
    if e.low is None or e.high is None:
        text = f"{e.name} = {quantity(e.value, e.unit, 4)}"
    else:
        value, low, high = (rounded(v, 0.5 * (e.high - e.low)) for v in (e.value, e.low, e.high))
        text = f"{e.name} = {value} {shown(e.unit)}".rstrip() + f" (95 %: {low} to {high})"
    if e.baseline:
        text += f", baseline {figures(e.baseline, 4)}"
    return text + (f", at its {e.at_bound} bound" if e.at_bound else "")


def rounded(value: float, uncertainty: float) -> str:
    """A value to two digits of its uncertainty: 0.09619 ± 0.0027 is '0.0962'."""
    if not uncertainty > 0.0:
        return figures(value, 4)
    # two digits of the uncertainty: the last digit shown is then about a tenth of it or less
    decimals = 1 - math.floor(math.log10(uncertainty))
    if decimals > MOST_DECIMALS:
        return f"{value:.4g}"
    # adding 0.0 turns -0.0 into 0.0
    return f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"


def counted(number: int, what: str) -> str:
    """'1 recording', '2 recordings'."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def evidence(sse_reduction: float) -> str:
    """Evidence (twice the log-likelihood ratio) as text: '37'; 'over 1000' where the number says nothing more; 'none' for a loss."""
    if sse_reduction < 0.0:
        return "none"
    return f"over {SURE}" if sse_reduction >= SURE else f"{sse_reduction:.0f}"


def between(member: GroupMember) -> str:
    """'evidence between the two only 2.3', or why a larger one does not decide."""
    difference = member.likelihood_difference
    if difference <= gates.SAME_LIKELIHOOD.threshold:
        return f"evidence between the two only {difference:.1f}"
    return f"evidence between the two {difference:.0f}, but it is better at some times and worse at others"


def expected_evidence(separation: Separation) -> str:
    """' (expected evidence 37)' of an experiment that separates two effects; empty where it was not computed."""
    if separation.expected_difference is None:
        return ""
    return f" (expected evidence {evidence(separation.expected_difference)})"


def alternatives(f: Finding, *, several: bool = False) -> str:
    """'leak, or drift, only from 12.0 to 40.0 s': the finding, the effects that these recordings cannot distinguish from it, and when they act.

    several: times name their recording.
    """
    return ", or ".join(f.members) + only_at(f.where, several=several)


def only_at(where: Where, *, several: bool) -> str:
    """', only from 12.0 to 40.0 s' of an effect that acts for a part of the time, else empty; several: with the recording's name."""
    if not where.temporary:
        return ""
    spans = [
        f"{f'{i.recording} ' if several else ''}from {span(i.start_s, i.end_s)}" for i in where.intervals
    ]
    return f", only {' and '.join(spans)}"


def error_ratio(ratio: float) -> str:
    """The ratio of two errors: '× 0.18', 'below × 0.01'."""
    return f"× {ratio:.2f}" if ratio >= SMALLEST_RATIO else f"below × {SMALLEST_RATIO}"


def share(part: float) -> str:
    """'18 %'; what is nearly nothing is 'under 1 %' and what is nearly all 'over 99 %', never '0 %' or '100 %'."""
    whole = round(100 * part)
    if whole == 0 and part > 0.0:
        return "under 1 %"
    return "over 99 %" if whole == 100 and part < 1.0 else f"{whole} %"


def most_improved(error: Mapping[str, float], count: int) -> tuple[dict[str, float], int]:
    """The channels whose error falls most, best first, and the number of all others."""
    ranked = sorted(error.items(), key=lambda item: item[1])
    return dict(ranked[:count]), max(len(ranked) - count, 0)


def smallest_detectable(c: Candidate, most: int = 2) -> str:
    """The size that would be detected with 80 % probability: '60 kg', '-0.07 from 1'; a dash where no size would."""
    sizes = [_change(e) for e in c.smallest_detectable]
    return ", ".join(sizes[:most]) + (", ..." if len(sizes) > most else "") or "–"


def _change(e: Estimate) -> str:
    """A size, or its difference from the baseline's where that is not 0."""
    if not e.baseline:
        return quantity(e.value, e.unit, 2)
    sign = "+" if e.value > e.baseline else ""
    return f"{sign}{quantity(e.value - e.baseline, e.unit, 2)} from {figures(e.baseline)}"


def remaining(result: Findings) -> list[str]:
    """How much is still wrong, and where: sentences that the reasons do not have already."""
    if not result.adequacy:
        return (
            ["How much is still wrong is not known: the file is of an earlier version"]
            if result.samples
            else []
        )
    several, rest = len(result.recordings) > 1, len(result.adequacy) - 1
    if not inadequate(result.adequacy):
        nearest = max(result.adequacy, key=lambda c: c.over)
        others = f"; {counted(rest, 'more channel')} further within" if rest else ""
        # a share above 1 may be chance, by how many independent samples there are
        at = "within" if nearest.over <= OVER_SHOWN else "not clearly beyond"
        return [f"{at} the error budgets: {left(nearest, several=several)}{others}"]
    if any(reason.startswith(STILL_WRONG) for reason in result.reasons):
        return []
    return [f"{STILL_WRONG}{left(c, several=several)}" for c in inadequate(result.adequacy)]


def wrong_values(result: Findings) -> list[str]:
    """'mass is 12900 kg, not 11800 kg': values of the baseline that these recordings surely contradict."""
    return [
        f"{e.name} is {quantity(e.value, e.unit, 4)}, not {quantity(e.baseline or 0.0, e.unit, 4)}"
        for e in (b.estimate for b in result.baseline_values if b.sure)
    ]


def value_or_effect(result: Findings) -> str:
    """'Either the baseline's weight is wrong, or torque constant acts'; empty where there is no such question."""
    return "; ".join(
        f"Either the baseline's {b.estimate.name} is wrong, or {' or '.join(b.or_effects[:MOST_EFFECTS])} acts: these recordings cannot distinguish them"
        for b in result.baseline_values
        if b.or_effects
    )


def budget(c: ChannelAdequacy) -> str:
    """'0.0103 m (differences)': what the sensor may be off by, and where that figure comes from."""
    factor, unit = readable(c.unit, c.budget)
    return f"{figures(c.budget / factor, 2)} {unit}".rstrip() + f" ({c.source})"


def errors(before: float, after: float, unit: str) -> str:
    """'0.61 → 0.02 m', '0.61 m' where nothing changed."""
    factor, name = readable(unit, max(before, after))
    sizes = [figures(value / factor, 2) for value in (before, after)]
    return f"{' → '.join(dict.fromkeys(sizes))} {name}".rstrip()


def missing_channel(missing: MissingChannel) -> str:
    """'speed was not recorded. It would have shown linear drag (0.3 m/s); distinguished gyro delay from servo delay.'"""
    shows = [f"{w.what} ({quantity(w.change, missing.unit, 2)})" for w in missing.would_judge[:MOST_EFFECTS]]
    pairs = [
        f"{w.what} ({quantity(w.change, missing.unit, 2)})" for w in missing.would_distinguish[:MOST_EFFECTS]
    ]
    uses = [f"shown {', '.join(shows)}"] if shows else []
    uses += [f"distinguished {', '.join(pairs)}"] if pairs else []
    state = "could not be used" if missing.recorded else "was not recorded"
    use = f"It would have {'; '.join(uses)}" if uses else "It would have added nothing"
    return f"{missing.channel} {state}. {use}."


def verdict(c: Candidate, result: Findings) -> str:
    """The verdict on a candidate; a finding that is not accepted as the cause is 'best proxy'."""
    proxy = c.verdict == "found" and c.effect not in result.named
    return "best proxy" if proxy else c.verdict


def by_reason(result: Findings) -> dict[str, list[str]]:
    """Effects that were not found, by verdict and reason; those ruled out come first."""
    found: dict[str, list[str]] = {}
    for kind in ("ruled out", "not needed", "negligible", "could not be judged"):
        for c in [c for c in result.candidates if c.verdict == kind]:
            found.setdefault(f"{kind.capitalize()}: {c.reason}", []).append(c.effect)
    return found
