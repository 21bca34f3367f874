"""Wild arms: truths that differ from the model in structure, as every real machine does, beside what is hidden.

The other arms' truth differs from the model only in what the library holds. Here each drive has two further differences, drawn by
chance: another law, or another sensor's vice, that no effect of the library describes; some come near one, which is then a fair name. What
is hidden is sized on the same drive without the differences.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from bench.proof import ball, car, oracle, straight, wild_loader
from bench.proof.arm import Arm, Truth, diagnosed
from bench.proof.body import Body
from bench.proof.difference import Difference, chosen, drawn
from bench.proof.difference import names as difference_names
from diagnosis.fleet.store import Row
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Simulate
from discrepancy.signals.recording import Array

STRENGTHS = (50.0, 250.0, 2500.0)
SEEDS = {"tuning": 100_000, "report": 200_000}
"""Rules are changed by what the tuning arms show; the report arms are run when nothing is to be changed any more."""


STRAIGHT = (
    Difference(name="resistance of another power", ranges={"power": (0.3, 0.8)}, fair=("quadratic drag",)),
    Difference(name="late brake", ranges={"brake_lag": (0.1, 0.4)}),
    Difference(name="backlash of the driveline", ranges={"backlash": (0.02, 0.08)}, fair=("motor lag",)),
    Difference(
        name="loss that grows with speed",
        ranges={"loss_by_speed": (0.01, 0.03)},
        fair=("drive loss", "quadratic drag"),
    ),
    Difference(name="torque ripple", ranges={"ripple": (0.02, 0.06)}),
    Difference(
        name="dry friction that falls with speed",
        ranges={"stribeck": (0.004, 0.015)},
        fair=("rolling resistance",),
    ),
    Difference(
        name="squat under acceleration", ranges={"squat": (0.003, 0.01)}, fair=("acceleration scale",)
    ),
    Difference(name="wheel out of round", ranges={"out_of_round": (0.002, 0.01)}),
    Difference(name="wandering speed", ranges={"wander": (0.005, 0.02)}),
    Difference(name="clock drift", ranges={"drift": (5e-5, 3e-4)}),
    Difference(name="outliers", ranges={"outliers": (0.001, 0.005)}),
    Difference(name="contact", ranges={"contact": (2e3, 8e3), "contact_at": (0.1, 0.9)}),
)
BALL = (
    Difference(
        name="drag of another power",
        ranges={"power": (-0.2, -0.5), "drag_coefficient": (0.1, 0.4)},
        fair=("quadratic drag", "linear drag"),
    ),
    Difference(
        name="wind that grows with height",
        ranges={"shear": (0.02, 0.1), "drag_coefficient": (0.1, 0.4)},
        fair=("linear drag", "quadratic drag"),
    ),
    Difference(name="spin", ranges={"spin": (0.01, 0.05)}, fair=("quadratic drag", "linear drag")),
    Difference(name="lens", ranges={"lens": (0.01, 0.06)}),
    Difference(name="pictures at other times", ranges={"jitter": (5e-4, 3e-3)}),
    Difference(name="outliers", ranges={"outliers": (0.005, 0.02)}),
)
CAR = (
    Difference(
        name="servo of limited rate", ranges={"servo_rate": (0.4, 1.2)}, fair=("servo lag", "servo delay")
    ),
    Difference(
        name="body that swings",
        ranges={"yaw_damping": (0.5, 1.0)},
        fair=("servo lag", "servo delay", "tyre relaxation"),
    ),
    Difference(name="camber of the road", ranges={"camber": (0.005, 0.02)}),
    Difference(name="slip of the driven wheels", ranges={"drive_slip": (0.02, 0.1)}, fair=("encoder scale",)),
    Difference(name="gyro that feels forces", ranges={"g_sensitivity": (0.003, 0.01)}, fair=("gyro scale",)),
    Difference(
        name="clock drift", ranges={"drift": (5e-5, 3e-4)}, fair=("gyro delay", "gyro lag")
    ),  # 2 to 9 ms on the average
    Difference(name="outliers", ranges={"outliers": (0.001, 0.005)}),
    Difference(name="wheels that lock", ranges={"slide": (0.5, 2.0)}),
    Difference(
        name="play of the steering", ranges={"play": (0.003, 0.01)}, fair=("servo delay", "servo lag")
    ),
)
BODIES: dict[str, Body] = {f"wild {body.name}": body for body in (straight.STRAIGHT, ball.BALL, car.CAR)}
DIFFERENCES_OF: dict[str, tuple[Difference, ...]] = {
    "wild straight": STRAIGHT,
    "wild ball": BALL,
    "wild car": CAR,
    wild_loader.BODY: wild_loader.DIFFERENCES,
}
"""By body, the loader's among them."""
NULLS, EFFECTS, TWINS = 70, 100, 16  # arms of a body, about


def arms(name: str, first_seed: int) -> Iterator[Arm]:
    """Some 200 arms of one body: nothing hidden, one effect, a pair, and an effect that has an exact twin in the library."""
    if name == wild_loader.BODY:
        yield from wild_loader.arms(first_seed)
        return
    body = BODIES[name]
    for repeat in range(NULLS):
        yield _arm(name, "null", first_seed + repeat)
    library = [e for e in body.model().effects if not e.parameters[0].discrete]
    repeats = max(1, round(EFFECTS / (len(library) * len(STRENGTHS))))
    number = 0
    for _ in range(repeats):
        for effect in library:
            for strength in STRENGTHS:
                yield _arm(name, "effect", first_seed + 1_000 + number, (effect.name,), strength)
                number += 1
    for number, pair in enumerate(body.pairs):
        yield _arm(name, "pair", first_seed + 2_000 + number, pair, 250.0)
    physics = [e for e in library if e.kind == "physics"]
    for number in range(TWINS):
        effect = physics[number % len(physics)]
        yield _arm(name, "twin", first_seed + 3_000 + number, (effect.name,), 250.0)


def _arm(name: str, kind: str, seed: int, effects: tuple[str, ...] = (), strength: float = 0.0) -> Arm:
    body = BODIES[name]
    return Arm(
        body=name,
        kind=kind,
        seed=seed,
        effects=effects,
        noise=body.noises[seed % len(body.noises)],
        strength=strength,
        what=difference_names(DIFFERENCES_OF[name], seed, effects) if kind != "twin" else "",
    )


def differences(arm: Arm) -> list[Difference]:
    """Those that the arm's truth has."""
    return chosen(arm, DIFFERENCES_OF[arm.body])


def fair(arm: Arm) -> set[str]:
    """Names that are right, or a fair description of what the truth has more than the model."""
    return {*arm.effects, *(name for d in differences(arm) for name in d.fair)}


def carried_out(arm: Arm) -> Row:
    """Size the hidden effects without the differences, record with them, diagnose."""
    if arm.body == wild_loader.BODY:
        return wild_loader.carried_out(arm, twinned)
    body = BODIES[arm.body]
    library = {effect.name: effect for effect in body.model().effects}
    tame = replace(arm, body=body.name, kind="effect", what="")
    sized = [body.sized(library[name], tame) for name in arm.effects]
    values = {name: value for one in sized for name, value in one.values.items()}
    extra = drawn(arm, DIFFERENCES_OF[arm.body])
    recordings = body.record({**extra, **values}, tame, np.random.default_rng(arm.seed))
    model = twinned(body.model(), library[arm.effects[0]]) if arm.kind == "twin" else body.model()
    reached = min((one.reached or 0.0 for one in sized), default=None)
    truth = Truth(values={**extra, **values}, reached=reached)
    if arm.effects:
        hidden = [library[name] for name in arm.effects]
        beside = oracle.measured(Problem(body.model(), recordings), hidden, values)
        truth = replace(truth, beside=beside.reached)
    return diagnosed(arm, model, recordings, truth)


def twinned(model: Model, effect: Effect) -> Model:
    """The model with a second effect in its library that does exactly what `effect` does, under another name."""
    renamed = {p.name: f"{p.name}_twin" for p in effect.parameters}
    twin = replace(
        effect,
        name=f"{effect.name} twin",
        parameters=tuple(replace(p, name=renamed[p.name]) for p in effect.parameters),
        confusable={},
    )
    simulate = Twinned(model.simulate, {p.name: p.value for p in effect.parameters}, renamed)
    return replace(model, effects=(*model.effects, twin), simulate=simulate)


class Twinned:
    """The simulation of a model in which the parameters of an effect act twice.

    off: values of the effect's parameters at which it does nothing; renamed: their names in the twin.
    """

    def __init__(self, alone: Simulate, off: Mapping[str, float], renamed: Mapping[str, str]) -> None:
        self._alone, self._off, self._renamed = alone, off, renamed
        # one window after the other, an arm of the loader takes more than half an hour
        if hasattr(alone, "together"):
            self.together = self._side_by_side

    def __call__(
        self, window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        """As of the model alone."""
        return self._alone(window, self._summed(values), extra)

    def _side_by_side(self, windows, values: Mapping[str, float]) -> list[dict[str, Array]]:
        return self._alone.together(windows, self._summed(values))

    def _summed(self, values: Mapping[str, float]) -> dict[str, float]:
        off, other = self._off, self._renamed
        both = {name: values.get(name, v) + values.get(other[name], v) - v for name, v in off.items()}
        return {**values, **both}
