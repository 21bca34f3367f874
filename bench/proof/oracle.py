"""Measures how visible a hidden effect is in a recording, with knowledge of the effect and its size.

lambda: squared change of the outputs that refitted nuisances and initial states cannot absorb, over the noise, plus the increase of the
prior conflict of the refitted nuisances; the correlation of the scores is taken into account.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bench.proof.arm import Truth
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect
from discrepancy.selection.assess import assess
from discrepancy.selection.screen import spread, time_blocks_of
from discrepancy.selection.state import Settings

LEAST = 1e-9  # lambda that counts as none


def measured(problem: Problem, effects: Sequence[Effect], values: Mapping[str, float]) -> Truth:
    """The truth with the lambda of the least visible effect, the others known. values: of all parameters of the effects."""
    names = tuple(effect.name for effect in effects)
    state = assess(problem, names, problem.start().having(**values), Settings())
    least: Truth | None = None
    for effect in effects:
        off = {p.name: p.value for p in effect.parameters}
        # refitted without the effect: what the rest can take over is not visible
        others = [name for name in state.fit.names if name not in off]
        without = fit(problem, state.noise, others, state.fit.values.with_shared(off))
        change = without.residual - state.fit.residual
        power = np.bincount(state.noise.row_channel, change**2, len(problem.channels))
        whole = max(float(np.sum(power)), LEAST)
        # a nuisance that has to leave its prior shows the effect too; never negative, fits end at a tolerance
        conflict = max(_prior_conflict(without) - _prior_conflict(state.fit), 0.0)
        reached = (float(np.sum(power)) + conflict) / spread(
            state.fit, effect.names, time_blocks_of(state.noise)
        )
        channels = {n: float(p / whole) for n, p in zip(problem.channels, power, strict=True)}
        if least is None or reached < (least.reached or 0.0):
            least = Truth(values=values, reached=reached, channels=channels)
    return least or Truth(values=values)


def _prior_conflict(fitted: Fit) -> float:
    """The part of a fit's SSE that comes from the priors."""
    return fitted.sse - fitted.data_sse
