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
    undetectable = [c.effect for c in candidates if c.verdict == "could not be judged"]
    rows = []
    for name in [n for n in problem.missing if n in base]:
        alone = base[name]
        judged = {
            e: _rms(_channel(problem, values, name, _typical(problem, e)) - alone) for e in undetectable
        }
        distinguished = {
            f"{x.effect} from {m.effect}": _rms(
                _channel(problem, values, name, _instead(problem, m, x))
                - _channel(problem, values, name, _instead(problem, x, m))
            )
            for x in found
            for m in x.group
        }
        size = float(np.std(alone))
        rows.append(
            f.MissingChannel(
                channel=name,
                unit=problem.model.outputs[name],
                recorded=any(c.signal == name for c in complaints),
                would_judge=_notable(judged, size),
                would_distinguish=_notable(distinguished, size),
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


def _channel(problem: Problem, values: Values, channel: str, changed: Mapping[str, float]) -> Array:
    return _simulated(problem, values.with_shared(changed))[channel]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _simulated(problem: Problem, values: Values) -> dict[str, Array]:
    """All outputs of all windows, recorded or not."""
    each = [problem.outputs(i, values) for i in range(len(problem.windows))]
    return {name: np.concatenate([part[name] for part in each]) for name in each[0]}


def _notable(changes: Mapping[str, float], size: float) -> list[f.WouldShow]:
    return [
        f.WouldShow(what=what, change=change, share=change / size)
        for what, change in sorted(changes.items(), key=lambda item: -item[1])
        if size > 0.0 and change > gates.CHANNEL_NOTABLE.threshold * size
    ]
