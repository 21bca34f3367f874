"""Whether a verdict depends on how often was sampled: arms of the small bodies, every 2nd, 4th and 8th sample of them.

    python -m bench.resampling [--bodies straight,ball,car] [--seeds 301,302] [--effects ...] [--as-recorded] [--out docs/results/resampling.md]

A verdict is unchanged if the same effects, or groups of them, are named and the intervals of the hidden one have values in common. Arms count where the hidden effect still has
a lambda of 50 in the thinnest recording. --as-recorded leaves every sample a row of its own, as a baseline.
"""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.proof import ball, car, oracle
from bench.proof.arm import Arm
from bench.proof.plan import BODIES
from bench.proof.report import commit, publish
from bench.proof.score import Share
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
UNCHANGED = 0.95  # share of verdicts that stay
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
    seed: int = 0

    @property
    def verdicts(self) -> dict[int, str]:
        """In words, by factor: the named effects with their groups, or the status where there is none."""
        return {
            factor: " + ".join(" or ".join(group) for group in groups_of(found)) or found.status
            for factor, found in self.found.items()
        }

    def same(self, factor: int) -> bool:
        """Whether a verdict is that of the finest recording."""
        one, other = self.found[min(self.found)], self.found[factor]
        # names first: intervals of different effects cannot be compared
        if sorted(groups_of(one)) != sorted(groups_of(other)):
            return False
        if not any(self.effect in group for group in groups_of(one)):
            return True
        pairs = zip(estimates(one, self.effect), estimates(other, self.effect), strict=True)
        return all(in_common(a, b) for a, b in pairs)


def groups_of(found: Findings) -> list[list[str]]:
    """Of each named finding the effects that the recording cannot distinguish. Which one leads is chance, so they are sorted."""
    return [sorted(f.members) for f in found.findings if f.named]


def estimates(found: Findings, effect: str) -> list[Estimate]:
    """What is estimated of an effect that is named, or is in a group."""
    finding = found.finding(effect)
    member = next((m for m in finding.group if m.effect == effect), None)
    return finding.parameters if member is None else member.parameters


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
    return Resampled(effect.name, found, known.reached or 0.0, seed)


def page(arms: Mapping[str, Sequence[Resampled]], command: str, commit: str) -> Iterator[str]:
    """The page of Markdown, line by line; the arms by body."""
    yield from (
        "# Verdicts and how often was sampled",
        "",
        f"`{command}`, commit {commit}.",
        "",
        "Each small body hides one effect of its typical size. It is recorded fast (the straight drive at 200 Hz, the ball at 480 pictures a second, the car's commands at 100 Hz),",
        "and every 2nd, 4th and 8th sample of the same recording is diagnosed anew; the commands are thinned as the measured channels are. A verdict is unchanged if the same",
        "effects are named, or the same groups of effects that the recording cannot distinguish (*or*), and the intervals of the hidden one have values in common.",
        f"Arms count where the hidden effect still has a lambda of {VISIBLE:.0f} in the thinnest recording. Shares have Wilson's 95 % interval.",
        "",
        f"| body | arms that count | {' | '.join(f'1 of {f} samples' for f in FACTORS[1:])} | target |",
        f"|---|---:|{'---|' * len(FACTORS)}",
    )
    for body, all_of in arms.items():
        counted = [arm for arm in all_of if arm.visible >= VISIBLE]
        shares = [Share(sum(arm.same(factor) for arm in counted), len(counted)) for factor in FACTORS[1:]]
        cells = [
            f"{share}{' **missed**' if share.of and share.hits < UNCHANGED * share.of else ''}"
            for share in shares
        ]
        yield f"| {body} | {len(counted)} of {len(all_of)} | {' | '.join(cells)} | >= {UNCHANGED:.0%} |"
    yield from (
        "",
        "## Every arm",
        "",
        "| body | hidden | seed | lambda in the thinnest | every sample | "
        + " | ".join(f"1 of {f}" for f in FACTORS[1:])
        + " |",
        f"|---|---|---:|---:|{'---|' * len(FACTORS)}",
    )
    for body, all_of in arms.items():
        for arm in all_of:
            cells = [
                verdict + ("" if arm.same(factor) or arm.visible < VISIBLE else " (**changed**)")
                for factor, verdict in arm.verdicts.items()
            ]
            yield f"| {body} | {arm.effect} | {arm.seed} | {arm.visible:.0f} | {' | '.join(cells)} |"


def main() -> None:
    """Diagnose all arms and print or write the page."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.resampling",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--bodies", default=",".join(FINEST))
    parser.add_argument("--seeds", default="301,302", help="by comma; below 300 they have been looked at")
    parser.add_argument("--effects", default="", help="by comma; default: all")
    parser.add_argument("--as-recorded", action="store_true", help="no sample is averaged with another")
    parser.add_argument("--out", type=Path, default=None, help="write the page here, else print it")
    chosen = parser.parse_args()
    only = [name for name in chosen.effects.split(",") if name]
    arms: dict[str, list[Resampled]] = {}
    for body in chosen.bodies.split(","):
        model = BODIES[body].model()
        if chosen.as_recorded:
            # the way back to a row per sample, without a switch in the engine for this benchmark
            model = replace(model, bandwidth_hz=TOO_FAST_HZ)
        effects = [e for e in model.effects if not only or e.name in only]
        arms[body] = []
        for seed in chosen.seeds.split(","):
            for effect in effects:
                arm = resampled(body, model, effect, int(seed))
                arms[body].append(arm)
                print(f"{body}, {effect.name}, seed {seed}: {arm.verdicts}", file=sys.stderr, flush=True)
    options = [
        f"--{name}={value}"
        for name in ("bodies", "seeds", "effects")
        if (value := getattr(chosen, name)) != parser.get_default(name)
    ]
    options += ["--as-recorded"] if chosen.as_recorded else []
    text = "\n".join(page(arms, shlex.join(["python", "-m", "bench.resampling", *options]), commit()))
    publish(text + "\n", chosen.out)


if __name__ == "__main__":
    main()
