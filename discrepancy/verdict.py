"""The verdict in one word and its reasons: explained, unknown, nothing missing, or inconclusive."""

from collections.abc import Sequence

from discrepancy import findings as f
from discrepancy.agreement import disagreements
from discrepancy.doubts import strained
from discrepancy.openended import OpenEnded
from discrepancy.problem import Problem
from discrepancy.state import CLEAR, Settings, State, Trial
from discrepancy.trials import confirm

FEW_SAMPLES = 30
SHOWN = 6  # effects in a reason; all candidates with their verdicts stand beside it


def verdict(
    problem: Problem,
    state: State,
    left_over: Sequence[Trial],
    found: Sequence[f.Finding],
    beyond: OpenEnded,
    candidates: Sequence[f.Candidate],
    settings: Settings,
) -> tuple[f.Status, list[str]]:
    """Status and reasons; left_over: what passed when the search ended at its limit."""
    silent = not found and not beyond.terms
    torn = _torn(problem, state, settings) if silent and not left_over else None
    status, reasons = _status(problem, found, beyond, candidates, torn)
    if status == "nothing missing":
        reasons += [f"{text}: the baseline is wrong there" for text in strained(problem, state.fit)]
        status = "inconclusive" if left_over else status
    reasons += disagreements(problem, state, [x.effect for x in found if x.named])
    return status, reasons + [
        f"the search ended at {settings.most_simulations} simulations though {t.effect} would help: the model is wrong by far, or in many ways"
        for t in left_over
    ]


def _torn(problem: Problem, state: State, settings: Settings) -> Trial | None:
    """The effect that helps held-out data far beyond chance though stretches of time disagree about it, if there is one: something is missing."""
    likely = max(state.trials, key=lambda t: t.lead, default=None)
    if likely is None or likely.plain < max(CLEAR, likely.needed):
        return None
    tried = confirm(problem, likely.beside or state, likely, settings)
    held_out = tried.held_out_gain or 0.0
    return tried if held_out > settings.confirmed * likely.plain and not tried.negligible(problem) else None


def _status(
    problem: Problem,
    found: Sequence[f.Finding],
    beyond: OpenEnded,
    candidates: Sequence[f.Candidate],
    torn: Trial | None,
) -> tuple[f.Status, list[str]]:
    reasons: list[str] = []
    if torn is not None:
        return "unknown", [
            f"{torn.effect} would help much ({torn.plain:.0f} where {torn.needed:.0f} is needed), but stretches of time disagree about it"
        ]
    if beyond.terms:
        reasons.append(f"the library leaves something that depends on known signals: {beyond.equation()}")
    reasons += [
        f"{x.effect} is the best proxy, cause unknown: {'; '.join(x.doubts)}" for x in found if not x.named
    ]
    wrong = [c.told for c in problem.complaints if c.fatal and c.signal in problem.missing]
    if any(x.named for x in found):
        return "explained", [
            *(
                reasons
                or [
                    "with it, no other effect and no known signal predicts the data that was not fitted any better"
                ]
            ),
            *wrong,
        ]
    if found or beyond.terms:
        return "unknown", [*reasons, *wrong]
    if problem.measured.size < FEW_SAMPLES:
        return "inconclusive", [f"{problem.measured.size} samples are too few to judge anything"]
    blind = [c for c in candidates if c.verdict == "could not be judged"]
    if candidates and len(blind) == len(candidates):
        return "inconclusive", ["none of the library's effects would have been noticed at a typical size"]
    reasons.append("no effect and no function of the known signals improves the prediction of held-out data")
    if blind:
        more = f" and {len(blind) - SHOWN} more of {len(candidates)}" if len(blind) > SHOWN else ""
        reasons.append(f"could not be judged here: {', '.join(c.effect for c in blind[:SHOWN])}{more}")
    if wrong:
        channels = ", ".join(problem.channels)
        return "inconclusive", [*wrong, f"in {channels} alone {reasons[0]}", *reasons[1:]]
    dead = [c.told for c in problem.complaints if c.signal in problem.missing]
    return "nothing missing", [*reasons, *dead]
