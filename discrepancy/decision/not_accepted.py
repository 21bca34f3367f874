"""A finding beside a candidate that promises more than it and was not accepted.

Where held-out data contradict the best candidate, the search goes on with the next best (ADR 93). If that one does what the other would do, its name is
borrowed: a law of the right kind with the wrong shape fits the recording and no other, and something else takes over a part of its work.
"""

from collections.abc import Collection, Sequence

from discrepancy import gates
from discrepancy.decision.drop_one import DropOneTest
from discrepancy.estimation.effort import BRIEF
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem
from discrepancy.selection.state import CandidateFit, State, free_names, switched_off


def taken_over(
    problem: Problem,
    state: State,
    trials: Sequence[CandidateFit],
    test: DropOneTest,
    group: Collection[str] = (),
) -> list[str]:
    """A caveat if a candidate with more evidence than the finding, not accepted, leaves less than half of the finding's.

    trials: of the last search; group: what the recordings cannot distinguish from the finding, and what is said with it.
    """
    rest = tuple(name for name in state.accepted if name != test.effect)
    off = switched_off(problem.model.effect(test.effect))
    for trial in trials:
        clear = trial.raw_sse_reduction > max(test.sse_reduction, gates.CLEAR.threshold, trial.threshold)
        if trial.effect in (*state.accepted, *group) or trial.reference or not clear:
            continue
        both, alone = (*state.accepted, trial.effect), (*rest, trial.effect)
        values = trial.fit.values
        with_it = fit(problem, state.noise, free_names(problem, both), values, effort=BRIEF)
        without = fit(problem, state.noise, free_names(problem, alone), values.with_shared(off), effort=BRIEF)
        left = (without.sse - with_it.sse) / test.sse_reduction
        if left < gates.LEFT_BESIDE_UNACCEPTED.threshold:
            return [
                f"beside {trial.effect}, which explains more and was not accepted, {max(left, 0.0):.0%} of its evidence is left"
            ]
    return []
