"""A body of truth: makes recordings independently of the model with which they are diagnosed."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from bench.proof import oracle
from bench.proof.arm import EXACT, LAMBDAS, Arm, Truth, diagnosed
from bench.proof.stamps import KINDS
from diagnosis.fleet.store import Row
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model
from discrepancy.signals.recording import Recording

Record = Callable[[Mapping[str, float], Arm, np.random.Generator], list[Recording]]
"""Truth by parameter name, arm (noise, interval), generator -> recordings; the baseline's own errors are drawn first."""

ROUNDS = 10  # of sizing an effect
NEAR = 0.1  # of the logarithm of the wanted lambda, at which a size is right
SQUARE = 2.0  # power of the size with which lambda grows, before it is known
SLOPES = (1.0, 6.0)  # between which that power is looked for
LONGEST = 1.6  # step in the logarithm of a size: five times
STAMPED = 10  # nulls on the grid for one of each other kind of stamps
BOUND = 0.9  # of the way to a parameter's bound, as far as effects go


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """The test plan of one small model."""

    name: str
    model: Callable[[], Model]
    record: Record
    noises: tuple[str, ...]
    nulls: int  # arms per noise and seed
    outside: Mapping[str, Mapping[str, float]] = field(
        default_factory=dict
    )  # truths that no effect of the library can be
    pairs: tuple[tuple[str, str], ...] = ()
    intervals: tuple[str, ...] = ()  # effects that act for a part of the time
    # inputs that the model holds and the truth moves; only where stamps leave the grid does that differ
    moving: tuple[str, ...] = ()
    peer: Callable[[list[Recording]], Mapping[str, str]] | None = (
        None  # another tool's answer on the same recordings
    )

    def arms(self, seeds: int) -> Iterator[Arm]:
        """The whole plan."""
        library = self.model().effects
        for seed in range(seeds):
            for number, noise in enumerate(self.noises):
                # every null is another drive: otherwise one random event would be counted once per noise
                for repeat in range(self.nulls):
                    # disjoint ranges of seeds by kind, so that no two arms share their random numbers
                    own = 10_000 + 1_000 * seed + len(self.noises) * repeat + number
                    yield self._arm("null", own, noise=noise)
                for place, what in enumerate(self.outside):
                    yield self._arm("outside", 20_000 + 1_000 * seed + place, noise=noise, what=what)
            yield from self._stamped(seed)
            for number, effect in enumerate(library):
                # a wrong sign has one size
                strengths = (np.inf,) if effect.parameters[0].discrete else LAMBDAS
                for level, strength in enumerate(strengths):
                    noise = self.noises[(number + level + seed) % len(self.noises)]
                    yield self._arm(
                        "effect",
                        30_000 + 1_000 * seed + 10 * number + level,
                        effects=(effect.name,),
                        noise=noise,
                        strength=strength,
                    )
            for number, pair in enumerate(self.pairs):
                noise = self.noises[(number + seed) % len(self.noises)]
                yield self._arm(
                    "pair", 50_000 + 1_000 * seed + number, effects=pair, noise=noise, strength=250.0
                )
            for number, effect in enumerate(self.intervals):
                yield self._interval(
                    effect, 60_000 + 1_000 * seed + number, self.noises[(number + seed) % len(self.noises)]
                )

    def _stamped(self, seed: int) -> Iterator[Arm]:
        """Nulls and clear effects with stamps that are not on the model's grid."""
        number, first = len(self.noises), 70_000 + 1_000 * seed
        for place in range(max(1, self.nulls // STAMPED) * number):
            for way, stamps in enumerate(KINDS):
                own = first + len(KINDS) * place + way
                yield self._arm("null", own, noise=self.noises[place % number], stamps=stamps)
        for place, effect in enumerate(e for e in self.model().effects if not e.parameters[0].discrete):
            for way, stamps in enumerate(KINDS):
                own = first + 500 + len(KINDS) * place + way
                noise = self.noises[(place + way + seed) % number]
                yield self._arm(
                    "effect", own, effects=(effect.name,), noise=noise, strength=EXACT, stamps=stamps
                )

    def _arm(self, kind: str, seed: int, **more) -> Arm:
        return Arm(body=self.name, kind=kind, seed=seed, **more)

    def _interval(self, effect: str, seed: int, noise: str) -> Arm:
        # 3: the interval must not depend on the numbers of the recording's noise
        rng = np.random.default_rng([seed, 3])
        # of 96 s: the effect begins and ends within the drive
        start = float(rng.uniform(10.0, 45.0))
        end = start + float(rng.uniform(25.0, 40.0))
        return self._arm(
            "interval", seed, effects=(effect,), noise=noise, strength=2500.0, start_s=start, end_s=end
        )

    def model_of(self, arm: Arm) -> Model:
        """The model with which an arm is diagnosed."""
        made = self.model()
        if not arm.stamps or not self.moving:
            return made
        # its manoeuvres hold these inputs, too
        return replace(made, held=tuple(x for x in made.held if x not in self.moving), manoeuvres=())

    def carried_out(self, arm: Arm) -> Row:
        """Size the hidden effects, record, diagnose, ask the peer."""
        library = {effect.name: effect for effect in self.model().effects}
        sized = [self.sized(library[name], arm) for name in arm.effects]
        values = {name: value for one in sized for name, value in one.values.items()}
        values |= self.outside.get(arm.what, {})
        recordings = self.record(values, arm, np.random.default_rng(arm.seed))
        # the peer knows no pairs, no intervals and only one grid of samples: there its answer would say nothing
        asked = arm.kind in ("null", "effect") and not arm.stamps
        beyond = self.peer(recordings) if self.peer and asked else {}
        # of a pair, the weaker one decides whether both can be found
        reached = min((one.reached or 0.0 for one in sized), default=None)
        channels = sized[0].channels if len(sized) == 1 else {}
        truth = Truth(values=values, reached=reached, channels=channels, beyond=beyond)
        return diagnosed(arm, self.model_of(arm), recordings, truth)

    def sized(self, effect: Effect, arm: Arm) -> Truth:
        """The change of an effect's parameter that has the wanted lambda on the very recordings that hold it.

        Secant steps in the logarithms of size and lambda: lambda need not grow with the square of a size, a limit on grip's grows with its
        fourth power. Where the parameter's bound comes first, lambda stays smaller.
        """
        parameter = effect.parameters[0]
        if np.isinf(arm.strength):
            return self._oracle(effect, {parameter.name: parameter.value + parameter.typical}, arm)
        furthest = BOUND * abs(
            (parameter.upper if parameter.typical > 0.0 else parameter.lower) - parameter.value
        )
        size, slope, moved = min(0.5 * abs(parameter.typical), furthest), SQUARE, 0.0
        tried: list[tuple[float, Truth]] = []
        while True:
            change = float(np.copysign(size, parameter.typical))
            truth = self._oracle(effect, {parameter.name: parameter.value + change}, arm)
            off = float(np.log(arm.strength / max(truth.reached or 0.0, oracle.LEAST)))
            tried.append((off, truth))
            if abs(off) < NEAR or len(tried) == ROUNDS:
                break
            if moved != 0.0:
                # the power found in the last step; clipped, because a saturating effect would send the size to infinity
                slope = float(np.clip((tried[-2][0] - off) / moved, *SLOPES))
            moved = float(np.clip(off / slope, -LONGEST, LONGEST))
            moved = min(moved, float(np.log(furthest / size)))
            if moved == 0.0:
                break
            size *= float(np.exp(moved))
        # not the last: steps may go past the best one
        return min(tried, key=lambda t: abs(t[0]))[1]

    def _oracle(self, effect: Effect, values: Mapping[str, float], arm: Arm) -> Truth:
        """lambda and its shares by channel on a recording that holds the effect throughout."""
        whole = Arm(body=arm.body, kind="effect", seed=arm.seed, noise=arm.noise, stamps=arm.stamps)
        problem = Problem(self.model_of(arm), self.record(values, whole, np.random.default_rng(arm.seed)))
        return oracle.measured(problem, [effect], values)
