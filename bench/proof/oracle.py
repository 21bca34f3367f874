"""How plainly a recording shows what was hidden in it, as told by one who knows the effect and its size.

lambda: what the effect changes beyond all refitted nuisances and initial states, squared, over the noise, and by how much those strain their
priors for it; correlation of the scores counted.
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


def told(problem: Problem, effects: Sequence[Effect], values: Mapping[str, float]) -> Truth:
    """The truth with the lambda of that effect which shows least, the others known; values: of all parameters of the effects.

    channels: shares of it.
    """
    names = tuple(effect.name for effect in effects)
    state = assess(problem, names, problem.start().having(**values), Settings())
    least: Truth | None = None
    for effect in effects:
        off = {p.name: p.value for p in effect.parameters}
        others = [name for name in state.fit.names if name not in off]
        without = fit(problem, state.noise, others, state.fit.values.with_shared(off))
        change = without.residual - state.fit.residual
        power = np.bincount(state.noise.row_channel, change**2, len(problem.channels))
        whole = max(float(np.sum(power)), LEAST)
        strained = max(_strain(without) - _strain(state.fit), 0.0)
        reached = (float(np.sum(power)) + strained) / spread(
            state.fit, effect.names, time_blocks_of(state.noise)
        )
        channels = {n: float(p / whole) for n, p in zip(problem.channels, power, strict=True)}
        if least is None or reached < (least.reached or 0.0):
            least = Truth(values=values, reached=reached, channels=channels)
    return least or Truth(values=values)


def _strain(fitted: Fit) -> float:
    """What the priors say of a fit, in SSE."""
    return fitted.sse - fitted.data_sse
