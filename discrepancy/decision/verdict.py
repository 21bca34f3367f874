"""The verdict in one word and its reasons: explained, explained in part, unknown, nothing missing, or inconclusive.

*Explained* and *nothing missing* need a model that is adequate: every channel within its error budget (discrepancy.decision.adequacy).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from discrepancy import gates
from discrepancy.decision.adequacy import granted, reading_error
from discrepancy.decision.agreement import disagreements
from discrepancy.estimation.problem import Problem
from discrepancy.selection.candidate_fits import confirm
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import CandidateFit, Settings, State
from discrepancy.signals import findings as f
from discrepancy.signals.adequacy import STILL_WRONG, ChannelAdequacy, ErrorPart, inadequate, left
from discrepancy.signals.quantities import figures, quantity
from discrepancy.signals.recording import Complaint

SHOWN = 6  # effects in a reason; the list of candidates has all of them
SHOWN_PROXIES = 2  # whose caveats are in the reasons; those of more are with the findings
SHOWN_CHANNELS = 3  # whose errors are in the reasons; all of them are in the findings
WOULD_HELP = "would still help"  # end of a reason: an effect that passed when the search ended


def verdict(
    problem: Problem,
    state: State,
    left_over: Sequence[CandidateFit],
    found: Sequence[f.Finding],
    equation: OpenEnded,
    candidates: Sequence[f.Candidate],
    complaints: Sequence[Complaint],
    channels: Sequence[ChannelAdequacy],
    values: Sequence[f.BaselineValue],
    settings: Settings,
    accepted: int,
) -> tuple[f.Status, list[str]]:
    """Status and reasons.

    channels: their errors beside their budgets; values: of the baseline that the recordings contradict; left_over: candidates that passed
    when the search ended at its limit; accepted: effects, when it ended.
    """
    inconsistent = None if left_over else _inconsistent(problem, state, settings)
    status, reasons = _status(problem, found, equation, candidates, complaints, inconsistent)
    if status == "nothing missing":
        status = "inconclusive" if left_over else status
    wrong = still_wrong(channels, several=len({w.recording for w in problem.windows}) > 1)
    if status == "nothing missing" and wrong:
        status = "unknown"
        reasons = [
            "the model misses something that no effect of the library and no known signal explains",
            *reasons,
        ]
    said = [*_contradicted_together(values)]
    contradict = [b for b in values if b.away > gates.PRIOR_CONFLICT.threshold]
    if status == "nothing missing" and contradict:
        # what was missing is no effect but a value, if that is certain
        status = "explained" if all(b.sure for b in contradict) else "inconclusive"
        reasons, said = [*said, *reasons], []
    cut_short = accepted >= settings.most_effects
    # what has only an equation has no name, however little it is
    unnamed = bool(equation.terms) or not all(x.named for x in found)
    # a value that is not certain to be wrong may stand for something that has no name
    open_question = not all(b.sure for b in contradict)
    further = granted(problem, channels)
    if status == "explained" and (wrong or left_over or cut_short or unnamed or open_question or further):
        status = "explained in part"
    reasons += [*said, *wrong, *(_at_an_end(problem, found, channels)), *(_granted(c) for c in further[:1])]
    if cut_short:
        reasons.append(f"the search ended at its limit of {settings.most_effects} effects; there may be more")
    reasons += _late_alike(problem, found)
    reasons += disagreements(problem, state, [x.effect for x in found if x.named])
    reasons += _not_looked_for(problem)
    return status, [*reasons, *(_would_still_help(t, settings) for t in left_over)]


def _would_still_help(left_over: CandidateFit, settings: Settings) -> str:
    if settings.over():
        return f"{left_over.effect} {WOULD_HELP}"
    return f"the search ended at {settings.most_simulations} simulations although {left_over.effect} {WOULD_HELP}: the model is far from the recordings, or wrong in many ways"


def _not_looked_for(problem: Problem) -> list[str]:
    """A sentence where the recordings are too short to look for effects that act for a part of the time."""
    count, least = len(problem.windows), gates.BLOCKS_TO_COMPARE.threshold
    if problem.costs.costly or count >= least:
        return []
    return [
        f"effects that act for a part of the time were not looked for: that needs {least:.0f} windows or more, and there are {count}"
    ]


def _at_an_end(
    problem: Problem, found: Sequence[f.Finding], channels: Sequence[ChannelAdequacy]
) -> Iterator[str]:
    """A sentence where all errors beyond their budgets lie at the ends of what acts for a while: these are known to a window only."""
    over = [p for c in channels for p in c.parts if p.over]
    longest = max(w.end_s - w.start_s for w in problem.windows)

    def ends_in(x: f.Finding, p: ErrorPart) -> bool:
        ends = [t for i in x.where.intervals if i.recording == p.recording for t in (i.start_s, i.end_s)]
        return any((p.start_s or 0.0) - longest <= t <= (p.end_s or 0.0) + longest for t in ends)

    brief = [x for x in found if x.named and x.where.temporary]
    there = [x.effect for x in brief if any(ends_in(x, p) for p in over)]
    if over and all(any(ends_in(x, p) for x in brief) for p in over):
        yield (
            f"that is where {' and '.join(there)} begins or ends: its times are known to a window of {quantity(longest, 's', 2)}, and in the window "
            "between it is simulated throughout or not at all; a shorter --window narrows them"
        )


def _late_alike(problem: Problem, found: Sequence[f.Finding]) -> Iterator[str]:
    """A sentence where all readings come late alike: from these recordings, their inputs may as well act late."""
    late: dict[str, f.Estimate] = {}
    for x in found:
        effect, first = problem.model.effect(x.effect), x.parameters[0]
        if x.named and first.name.endswith(".delay") and first.value > 0.0:
            late |= dict.fromkeys(effect.readings or (effect.reading,), first)
    times = [late[c] for c in problem.channels if c in late]
    alike = all(one.overlaps(other) for one in times for other in times)
    if problem.model.inputs and len(times) == len(problem.channels) and alike:
        shift = quantity(float(np.mean([t.value for t in times])), times[0].unit, 2)
        all_of = "the only reading comes" if len(times) == 1 else "all readings come"
        yield f"{all_of} late by {shift}: {', '.join(problem.model.inputs)} acting late by that, or stamped early, would look the same"


def _contradicted_together(values: Sequence[f.BaselineValue]) -> Iterator[str]:
    """A sentence for each value, or one for all that the same effects may be behind."""
    by_effects: dict[tuple[str, ...], list[f.BaselineValue]] = {}
    for b in values:
        by_effects.setdefault(tuple(b.or_effects) or (b.estimate.name,), []).append(b)
    for effects, those in by_effects.items():
        if len(those) == 1:
            yield contradicted(those[0])
            continue
        wrong = ", ".join(
            f"{e.name} {quantity(e.value, e.unit, 4)}, not {quantity(e.baseline or 0.0, e.unit, 4)}"
            for e in (b.estimate for b in those)
        )
        yield (
            f"either {len(those)} values of the baseline are wrong ({wrong}), or one effect acts that these recordings cannot distinguish from them: {', '.join(effects[:SHOWN])}"
        )


def contradicted(b: f.BaselineValue) -> str:
    """'the baseline's mass is 12900 kg (95 %: 12700 to 13100 kg), not 11800 kg: 6.2 standard deviations of its prior'."""
    e = b.estimate
    value, low, high, assumed = (
        "unknown" if x is None else quantity(x, e.unit, 4) for x in (e.value, e.low, e.high, e.baseline)
    )
    size = f"{value} (95 %: {low} to {high})"
    away = f"{figures(b.away, 2)} standard deviations of its prior"
    if b.sure:
        return f"the baseline's {e.name} is {size}, not {assumed}: {away}"
    if b.or_effects:
        effects = ", ".join(b.or_effects[:SHOWN])
        return f"either the baseline's {e.name} is {size}, not {assumed} ({away}), or an effect acts that these recordings cannot distinguish from it: {effects}"
    if e.at_bound:
        bound = quantity((e.low if e.at_bound == "lower" else e.high) or 0.0, e.unit, 4)
        size = f"its bound, {bound}"
    return f"the baseline's {e.name} was pushed from {assumed} to {size}, {away}: it may stand in for something else"


def _granted(c: ChannelAdequacy) -> str:
    """'motor_speed is simulated to 1.37 rad/s, 12 times what a reading is off by: ...'."""
    times = figures(c.simulated / reading_error(c), 2)
    return (
        f"{c.channel} is simulated to {quantity(c.simulated, c.unit, 2)}, {times} times what a reading is off by: that is within a tenth of its movement, "
        "which is granted for disturbances that were not recorded; with `disturbances` in the model it is judged by what they can do"
    )


def still_wrong(channels: Sequence[ChannelAdequacy], *, several: bool) -> list[str]:
    """Sentences on the channels beyond their error budgets, the furthest first; several: times name their recording."""
    beyond = inadequate([*channels])
    more = len(beyond) - SHOWN_CHANNELS
    said = [f"{STILL_WRONG}{left(c, several=several)}" for c in beyond[:SHOWN_CHANNELS]]
    return [*said, f"{STILL_WRONG}{more} more channels"] if more > 0 else said


def _inconsistent(problem: Problem, state: State, settings: Settings) -> CandidateFit | None:
    """The effect that clearly improves held-out data although blocks of time disagree on its size; None if there is none."""
    others = [t for t in state.trials if t.effect not in state.accepted]
    likely = max(others, key=lambda t: t.margin, default=None)
    if likely is None or likely.raw_sse_reduction < max(gates.CLEAR.threshold, likely.threshold):
        return None
    tried = confirm(problem, likely.reference or state, likely, settings)
    held_out = tried.held_out_sse_reduction or 0.0
    confirmed = held_out > settings.confirmed * likely.raw_sse_reduction
    return tried if confirmed and not tried.negligible(problem) else None


def _status(
    problem: Problem,
    found: Sequence[f.Finding],
    equation: OpenEnded,
    candidates: Sequence[f.Candidate],
    complaints: Sequence[Complaint],
    inconsistent: CandidateFit | None,
) -> tuple[f.Status, list[str]]:
    reasons: list[str] = []
    if equation.terms:
        stands_for = "; ".join(
            dict.fromkeys(t.function.meaning for t in equation.terms if t.function.meaning)
        )
        reasons.append(
            f"a difference that the library does not explain depends on known signals: {equation.equation()}"
            + (f" ({stands_for})" if stands_for else "")
        )
    reasons += of_proxies([x for x in found if not x.named])
    if inconsistent is not None:
        evidence, least = inconsistent.raw_sse_reduction, inconsistent.threshold
        reasons.append(
            f"{inconsistent.effect} would improve the prediction much (evidence {evidence:.0f}, threshold {least:.0f}), but blocks of time disagree on its size"
        )
    wrong = [c.described for c in complaints if c.fatal and c.signal in problem.missing]
    if any(x.named for x in found):
        whom = "it" if len(found) == 1 else "them"
        enough = f"with {whom}, no other effect of the library and no function of the known signals that was tried improves the prediction of held-out data"
        return "explained in part" if inconsistent else "explained", [*(reasons or [enough]), *wrong]
    if found or equation.terms or inconsistent:
        return "unknown", [*reasons, *wrong]
    return _nothing_found(problem, candidates, complaints, wrong)


def of_proxies(proxies: Sequence[f.Finding]) -> list[str]:
    """Why they have no name; of many, which they are."""
    if len(proxies) > SHOWN_PROXIES:
        *others, last = (x.effect for x in proxies)
        return [
            f"{', '.join(others)} and {last} are only best proxies, their causes are unknown; the reasons stand with each"
        ]
    return [
        f"{x.effect} is only the best proxy, the cause is unknown: {'; '.join(x.caveats)}" for x in proxies
    ]


def _nothing_found(
    problem: Problem, candidates: Sequence[f.Candidate], complaints: Sequence[Complaint], wrong: list[str]
) -> tuple[f.Status, list[str]]:
    """Nothing missing, or inconclusive; wrong: fatal complaints about channels that could not be used."""
    if problem.measured.size < gates.SAMPLES_TO_JUDGE.threshold:
        return "inconclusive", [f"{problem.measured.size} samples are too few to judge anything"]
    undetectable = [c for c in candidates if c.verdict == "could not be judged"]
    if candidates and len(undetectable) == len(candidates):
        return "inconclusive", ["these recordings would show no effect of the library at its typical size"]
    reasons = [
        "no effect of the library and no function of the known signals that was tried improves the prediction of held-out data"
    ]
    if undetectable:
        more = len(undetectable) - SHOWN
        ending = f" and {more} more of {len(candidates)}" if more > 0 else ""
        reasons.append(
            f"could not be judged here: {', '.join(c.effect for c in undetectable[:SHOWN])}{ending}"
        )
    if wrong:
        channels = ", ".join(problem.channels)
        return "inconclusive", [*wrong, f"in {channels} alone {reasons[0]}", *reasons[1:]]
    dead = [c.described for c in complaints if c.signal in problem.missing]
    return "nothing missing", [*reasons, *dead]
