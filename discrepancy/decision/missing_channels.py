"""Channels that were not recorded or could not be used: which effects they would have shown, which rivals they would have distinguished."""

from collections.abc import Mapping, Sequence

import numpy as np

from discrepancy import gates
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.state import State
from discrepancy.signals import findings as f
from discrepancy.signals.recording import Array, Complaint

_Rival = f.Finding | f.GroupMember


def missing_channels(
    problem: Problem,
    state: State,
    candidates: Sequence[f.Candidate],
    found: Sequence[f.Finding],
    complaints: Sequence[Complaint],
) -> list[f.MissingChannel]:
    """One entry per output of the model without samples."""
    if not problem.missing:
        return []
    values = state.fit.values
    base = _simulated(problem, values)
    missing = [name for name in problem.missing if name in base]

    def changes(one: Mapping[str, float], other: Mapping[str, Array]) -> dict[str, float]:
        """By how much each missing channel is another one with these values."""
        moved = _simulated(problem, values.with_shared(one))
        return {name: _rms(moved[name] - other[name]) for name in missing}

    # one simulation shows what an effect does to all channels
    judged = {
        c.effect: changes(_typical(problem, c.effect), base)
        for c in candidates
        if c.verdict == "could not be judged"
    }
    distinguished = {
        f"{x.effect} from {m.effect}": changes(
            _instead(problem, m, x), _simulated(problem, values.with_shared(_instead(problem, x, m)))
        )
        for x in found
        for m in x.group
    }
    rows = []
    for name in missing:
        size = float(np.std(base[name]))
        rows.append(
            f.MissingChannel(
                channel=name,
                unit=problem.model.outputs[name],
                recorded=any(c.signal == name for c in complaints),
                would_judge=_notable({what: by[name] for what, by in judged.items()}, size),
                would_distinguish=_notable({what: by[name] for what, by in distinguished.items()}, size),
            )
        )
    return rows


def _typical(problem: Problem, effect: str) -> dict[str, float]:
    of = problem.model.effect(effect)
    return {p.name: p.value + p.typical for p in of.parameters}


def _instead(problem: Problem, of: _Rival, by: _Rival) -> dict[str, float]:
    """Parameter values with the effect of `of` off and that of `by` at its fitted size."""
    off = {p.name: p.value for p in problem.model.effect(of.effect).parameters}
    return {**off, **{e.name: e.value for e in by.parameters}}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _simulated(problem: Problem, values: Values) -> dict[str, Array]:
    """All outputs of all windows, recorded or not."""
    each = problem.all_outputs(values)
    return {name: np.concatenate([part[name] for part in each]) for name in each[0]}


def _notable(changes: Mapping[str, float], size: float) -> list[f.WouldShow]:
    return [
        f.WouldShow(what=what, change=change, share=change / size)
        for what, change in sorted(changes.items(), key=lambda item: -item[1])
        if size > 0.0 and change > gates.CHANNEL_NOTABLE.threshold * size
    ]
