"""Whether a verdict depends on how often was sampled: arms of the small bodies, every 2nd, 4th and 8th sample of them.

    python -m bench.resampling [--bodies straight,ball,car] [--seeds 1] [--effects ...] [--as-recorded]

A verdict is unchanged if the same effects are named and the intervals of the hidden one have values in common. Arms count where the hidden effect still has
a lambda of 50 in the thinnest recording. --as-recorded leaves every sample a row of its own, as a baseline.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.proof import ball, car, oracle
from bench.proof.arm import Arm
from bench.proof.plan import BODIES
from bench.proof.straight_truth import WHITE, record
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model
from discrepancy.models.straight import MASS_KG
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Estimate, Findings
from discrepancy.signals.recording import Recording, Signal

FACTORS = (1, 2, 4, 8)
EVERYTHING = Settings(average=True)
VISIBLE = 50.0  # lambda from which the proof expects a name
TOO_FAST_HZ = 1e6  # a bandwidth beyond that of every recording: nothing is averaged

Recorded = Callable[[Mapping[str, float], int], list[Recording]]
"""Truth and seed -> recordings at the finest rate."""


def straight(values: Mapping[str, float], seed: int) -> list[Recording]:
    """A drive at 200 Hz, eight times the rate of the proof; the driver acts at 25 Hz."""
    rng = np.random.default_rng(seed)
    machine = {"mass": MASS_KG * (1.0 + 0.03 * rng.normal()), "viscous": 400.0}
    return [record({**machine, **values}, WHITE, rng, keep=1)]


def thrown(values: Mapping[str, float], seed: int) -> list[Recording]:
    """Three throws at 480 pictures a second, eight times the rate of the proof."""
    arm, rng = Arm(body="ball", kind="effect", seed=seed, noise="white"), np.random.default_rng(seed)
    return ball.recorded(values, arm, rng, 8.0 * ball.PICTURES_HZ)


def driven(values: Mapping[str, float], seed: int) -> list[Recording]:
    """A minute of the car at the rates of the proof: its commands at 100 Hz move slowly, and bear to be thinned."""
    return car.recorded(
        values, Arm(body="car", kind="effect", seed=seed, noise="white"), np.random.default_rng(seed)
    )


FINEST: Mapping[str, Recorded] = {"straight": straight, "ball": thrown, "car": driven}


def thinned(recordings: Sequence[Recording], factor: int) -> list[Recording]:
    """Every so many-th sample of every channel."""
    return [
        replace(
            r,
            signals={
                name: Signal(s.time_s[::factor], s.value[::factor], s.unit, s.held)
                for name, s in r.signals.items()
            },
        )
        for r in recordings
    ]


@dataclass(frozen=True, slots=True)
class Resampled:
    """The verdicts on one arm, by factor."""

    effect: str
    found: Mapping[int, Findings]
    visible: float  # lambda in the thinnest recording

    def same(self, factor: int) -> bool:
        """Whether a verdict is that of the finest recording."""
        one, other = self.found[min(self.found)], self.found[factor]
        # names first: intervals of different effects cannot be compared
        if set(one.named) != set(other.named):
            return False
        if self.effect not in one.named:
            return True
        pairs = zip(one.finding(self.effect).parameters, other.finding(self.effect).parameters, strict=True)
        return all(in_common(a, b) for a, b in pairs)


def in_common(one: Estimate, other: Estimate) -> bool:
    """Whether two intervals have values in common."""
    low, high = max(_ends(one)[0], _ends(other)[0]), min(_ends(one)[1], _ends(other)[1])
    return low <= high


def _ends(of: Estimate) -> tuple[float, float]:
    return -np.inf if of.low is None else of.low, np.inf if of.high is None else of.high


def resampled(
    body: str,
    model: Model,
    effect: Effect,
    seed: int,
    factors: Sequence[int] = FACTORS,
    settings: Settings = EVERYTHING,
) -> Resampled:
    """One arm with an effect of typical size, diagnosed at each rate."""
    # typical size: what the library says a user would meet
    values = {p.name: p.value + p.typical for p in effect.parameters}
    finest = FINEST[body](values, seed)
    found = {factor: examine(model, thinned(finest, factor), settings) for factor in factors}
    # in the thinnest recording: an effect that is lost there by thinning is no change of the verdict
    known = oracle.measured(Problem(model, thinned(finest, max(factors))), [effect], values)
    return Resampled(effect.name, found, known.reached or 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", default=",".join(FINEST))
    parser.add_argument("--seeds", default="1", help="by comma")
    parser.add_argument("--effects", default="", help="by comma; default: all")
    parser.add_argument("--as-recorded", action="store_true", help="no sample is averaged with another")
    chosen = parser.parse_args()
    only = [name for name in chosen.effects.split(",") if name]
    for body in chosen.bodies.split(","):
        model = BODIES[body].model()
        if chosen.as_recorded:
            # the way back to a row per sample, without a switch in the engine for this benchmark
            model = replace(model, bandwidth_hz=TOO_FAST_HZ)
        effects = [e for e in model.effects if not only or e.name in only]
        arms = [
            _printed(body, resampled(body, model, effect, int(seed)))
            for seed in chosen.seeds.split(",")
            for effect in effects
        ]
        counted = [arm for arm in arms if arm.visible >= VISIBLE]
        for factor in FACTORS[1:]:
            same = sum(arm.same(factor) for arm in counted)
            print(f"{body}: every {factor}th sample: {same} of {len(counted)} verdicts unchanged")


def _printed(body: str, arm: Resampled) -> Resampled:
    """The arm, after its line is printed."""
    verdicts = ", ".join(
        f"/{factor} {' + '.join(found.named) or found.status}" for factor, found in arm.found.items()
    )
    print(
        f"{body}, {arm.effect} (lambda {arm.visible:.0f} in the thinnest): {verdicts}; same: {[arm.same(f) for f in arm.found]}",
        flush=True,
    )
    return arm


if __name__ == "__main__":
    main()
