"""A linear drive with a ball screw: the EMPS benchmark of Janot, Gautier and Brunot (2019), 500 Hz."""

import math
from collections.abc import Mapping
from typing import Any

import numba
import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

CREEP_M_S = 1e-3  # speed within which the direction of dry friction is not certain


def _moved(
    force: Array, h: float, mass: float, viscous: float, dry: float, place: float, speed: float
) -> Array:
    places = np.empty(force.size)
    for i, pushed in enumerate(force):
        places[i] = place
        before = speed
        speed += h / mass * (pushed - viscous * speed - dry * math.tanh(speed / CREEP_M_S))
        place += 0.5 * h * (before + speed)
    return places


_compiled: Any = numba.njit(_moved)


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    force = window["force"] + extra.get("force", 0.0) - values.get("offset", 0.0)
    friction = values.get("viscous", 0.0), values.get("dry", 0.0)
    start = values["start"], values["start_speed"]
    return {"position": _compiled(force, window.step_s, values["mass"], *friction, *start)}


def _first_speed(window: Window) -> float:
    """The slope of the first readings, 20 ms [m/s]."""
    return float(np.polyfit(window.time_s[:6], window["position"][:6], 1)[0])


def _friction(name: str, sentence: str, equation: str, parameter: Parameter) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=(parameter,), kind="physics", place="screw and guides",
        excited_by="both directions at several speeds",
    )  # fmt: skip


model = Model(
    name="emps",
    sentence="a mass that is pushed by a motor's force",
    inputs={"force": "N"},
    held=("force",),
    outputs={"position": "m"},
    columns={"force": "motor force"},
    nuisances=(
        Parameter(name="mass", unit="kg", value=95.0, lower=50.0, upper=200.0, typical=2.0, prior_sd=5.0),
        Parameter(
            name="start", unit="m", typical=0.001, scope="window", guess=lambda window: window.at_start("position")
        ),
        Parameter(name="start_speed", unit="m/s", typical=0.01, scope="window", guess=_first_speed),
    ),
    effects=(
        _friction(
            "viscous friction", "the drive resists in proportion to its speed", "M dv/dt = F - Fv v",
            Parameter(name="viscous", unit="N.s/m", lower=0.0, upper=2000.0, typical=50.0),
        ),
        _friction(
            "dry friction", "the drive resists with a constant force", "M dv/dt = F - Fc sign(v)",
            Parameter(name="dry", unit="N", lower=0.0, upper=200.0, typical=5.0),
        ),
        _friction(
            "offset of the force", "the motor's force is off by a constant", "M dv/dt = F - F0",
            Parameter(name="offset", unit="N", lower=-100.0, upper=100.0, typical=2.0),
        ),
        *sensor_effects("position", "m", bias=0.001, kinds=("scale", "delay")),
    ),
    simulate=simulate,
    step_s=0.004,
    window_s=1.0,
)  # fmt: skip
