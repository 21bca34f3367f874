"""Straight driving: Runge-Kutta at 5 ms in closed loop against the model's exponential midpoint steps; CAN resolution."""

import numpy as np

from bench.proof.arm import Arm
from bench.proof.body import Body
from bench.proof.sindy import terms_first
from bench.proof.straight_truth import COLOURED, QUANTISED, WHITE, record
from discrepancy.models.straight import LIBRARY, MASS_KG, model
from discrepancy.signals.recording import Recording

NOISES = {"white": WHITE, "coloured": COLOURED, "quantised": QUANTISED}


def recorded(values, arm: Arm, rng: np.random.Generator) -> list[Recording]:
    """One drive of 96 s with a machine within the priors of the nuisances."""
    machine = {
        "mass": MASS_KG * (1.0 + 0.03 * rng.normal()),
        "viscous": max(400.0 + 100.0 * rng.normal(), 50.0),
    }
    interval = (arm.start_s, arm.end_s) if arm.start_s is not None and arm.end_s is not None else None
    return [record({**machine, **values}, NOISES[arm.noise], rng, interval=interval, stamps=arm.stamps)]


def sindy(recordings: list[Recording]) -> dict[str, str]:
    """pysindy on the same drive, with the exact terms and its best threshold in hindsight."""
    return {"pysindy": ", ".join(sorted(terms_first(recordings[0])))}


NAMES = [effect.name for effect in LIBRARY]
STRAIGHT = Body(
    name="straight",
    model=model,
    record=recorded,
    noises=("white", "coloured", "quantised"),
    nulls=100,
    outside={
        "hysteresis 1 kN": {"hysteresis": 1_000.0},
        "hysteresis 2 kN": {"hysteresis": 2_000.0},
        "hysteresis 3 kN": {"hysteresis": 3_000.0},
        "warming oil 30 %": {"warming": 0.3},
        "warming oil 60 %": {"warming": 0.6},
    },
    pairs=tuple((NAMES[i], NAMES[(i + 5) % len(NAMES)]) for i in range(0, len(NAMES), 2)),
    intervals=("slope", "rolling resistance", "drive loss", "reverse drag"),
    peer=sindy,
)
