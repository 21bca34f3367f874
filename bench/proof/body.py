"""A body of truth: a way to make recordings that owes nothing to the model they are diagnosed with."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from bench.proof.arm import LAMBDAS, Arm, Truth, diagnosed
from discrepancy.assess import assess
from discrepancy.model import Effect, Model
from discrepancy.problem import Problem
from discrepancy.recording import Recording
from discrepancy.screen import spread, stretches
from discrepancy.state import Settings
from discrepancy.trials import project_out
from hil.scale.store import Row

Record = Callable[[Mapping[str, float], Arm, np.random.Generator], list[Recording]]
"""Truth by parameter name, arm (noise, stretch), generator -> recordings; the baseline's own errors are drawn first."""

ROUNDS = 5  # of sizing an effect
NEAR = 0.05  # of the wanted strength at which its size is right


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """How one small model is put to the test.

    noises; nulls: arms per noise and seed; outside: parameters of truths that no effect of the library is; pairs; stretches: effects that act
    for a part of the time; peer: another tool's answer on the same recordings.
    """

    name: str
    model: Callable[[], Model]
    record: Record
    noises: tuple[str, ...]
    nulls: int
    outside: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    pairs: tuple[tuple[str, str], ...] = ()
    stretches: tuple[str, ...] = ()
    peer: Callable[[list[Recording]], Mapping[str, str]] | None = None

    def arms(self, seeds: int) -> Iterator[Arm]:
        """The whole plan."""
        library = [effect.name for effect in self.model().effects]
        for seed in range(seeds):
            for noise in self.noises:
                for repeat in range(self.nulls):
                    yield self._arm("null", 10_000 + 1_000 * seed + repeat, noise=noise)
                for number, what in enumerate(self.outside):
                    yield self._arm("outside", 20_000 + 1_000 * seed + number, noise=noise, what=what)
            for number, effect in enumerate(library):
                for level, strength in enumerate(LAMBDAS):
                    noise = self.noises[(number + level + seed) % len(self.noises)]
                    yield self._arm(
                        "effect",
                        30_000 + 1_000 * seed + 10 * number + level,
                        effects=(effect,),
                        noise=noise,
                        strength=strength,
                    )
            for number, pair in enumerate(self.pairs):
                noise = self.noises[(number + seed) % len(self.noises)]
                yield self._arm(
                    "pair", 50_000 + 1_000 * seed + number, effects=pair, noise=noise, strength=250.0
                )
            for number, effect in enumerate(self.stretches):
                yield self._stretch(
                    effect, 60_000 + 1_000 * seed + number, self.noises[(number + seed) % len(self.noises)]
                )

    def _arm(self, kind: str, seed: int, **more) -> Arm:
        return Arm(body=self.name, kind=kind, seed=seed, **more)

    def _stretch(self, effect: str, seed: int, noise: str) -> Arm:
        rng = np.random.default_rng([seed, 3])
        start = float(rng.uniform(10.0, 45.0))
        end = start + float(rng.uniform(25.0, 40.0))
        return self._arm(
            "stretch", seed, effects=(effect,), noise=noise, strength=2500.0, start_s=start, end_s=end
        )

    def carried_out(self, arm: Arm) -> Row:
        """Size the hidden effects, record, diagnose, ask the peer."""
        library = {effect.name: effect for effect in self.model().effects}
        sized = [self._sized(library[name], arm) for name in arm.effects]
        values = {name: value for one in sized for name, value in one.values.items()}
        values |= self.outside.get(arm.what, {})
        recordings = self.record(values, arm, np.random.default_rng(arm.seed))
        beyond = self.peer(recordings) if self.peer and arm.kind in ("null", "effect") else {}
        reached = min((one.reached or 0.0 for one in sized), default=None)
        channels = sized[0].channels if len(sized) == 1 else {}
        truth = Truth(values=values, reached=reached, channels=channels, beyond=beyond)
        return diagnosed(arm, self.model(), recordings, truth)

    def _sized(self, effect: Effect, arm: Arm) -> Truth:
        """The change of an effect's parameter that has the wanted lambda on the very recordings that hold it.

        Told by an oracle that knows the effect: its squared size over the variance of its estimate, all nuisances refitted, correlation of the
        scores counted. Where the parameter's bound comes first, lambda stays smaller.
        """
        parameter = effect.parameters[0]
        size, seen, channels = 0.5 * parameter.typical, 0.0, dict[str, float]()
        whole = Arm(body=arm.body, kind="effect", seed=arm.seed, noise=arm.noise)
        for _ in range(ROUNDS):
            values = {parameter.name: parameter.value + size}
            problem = Problem(self.model(), self.record(values, whole, np.random.default_rng(arm.seed)))
            state = assess(problem, (effect.name,), problem.start().having(**values), Settings())
            direction = project_out(state.fit, [state.fit.names.index(parameter.name)])
            inflation = spread(state.fit, [parameter.name], stretches(state.noise))
            power = np.sum(direction**2, axis=1)
            seen = size**2 * float(np.sum(power)) / inflation
            channels = {
                name: float(np.sum(power[state.noise.row_channel == i]) / max(float(np.sum(power)), 1e-300))
                for i, name in enumerate(problem.channels)
            }
            factor = float(np.clip(np.sqrt(arm.strength / max(seen, 1e-9)), 0.2, 5.0))
            if abs(factor - 1.0) < NEAR:
                break
            room = (parameter.upper if size > 0.0 else parameter.lower) - parameter.value
            wanted = size * factor
            size = wanted if abs(wanted) < 0.9 * abs(room) else 0.9 * room
        return Truth(values={parameter.name: parameter.value + size}, reached=seen, channels=channels)
