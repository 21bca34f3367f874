"""An electronic mass on a spring: the Silverbox benchmark of Wigren and Schoukens (2013), 610 Hz.

Volts stand for force and for displacement, as published.
"""

from collections.abc import Mapping
from typing import Any

import numba
import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects


def _shaken(
    force: Array, h: float, w: float, damping: float, cubic: float, square: float, drag: float, place: float, speed: float
) -> Array:  # fmt: skip
    """Leapfrog, second order in the step; the force is taken at both ends of it, because a step is a twentieth of a swing."""
    places = np.empty(force.size)
    for i in range(force.size):
        places[i] = place
        push = force[i] - w * w * (place + square * place * place + cubic * place**3)
        half = speed + 0.5 * h * (push - (2.0 * damping * w + drag * abs(speed)) * speed)
        place += h * half
        push = force[min(i + 1, force.size - 1)] - w * w * (place + square * place * place + cubic * place**3)
        speed = (half + 0.5 * h * push) / (1.0 + 0.5 * h * (2.0 * damping * w + drag * abs(half)))
    return places


_compiled: Any = numba.njit(_shaken)


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    w = 2.0 * np.pi * values["frequency"]
    force = w * w * values["gain"] * (window["force"] + extra.get("force", 0.0) - values["offset"])
    bent = values.get("cubic", 0.0), values.get("square", 0.0), values.get("drag", 0.0)
    start = values["start"], values["start_speed"]
    return {"place": _compiled(force, window.step_s, w, values["damping"], *bent, *start)}


def _spring(name: str, sentence: str, equation: str, place: str, parameter: Parameter) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=(parameter,), kind="physics", place=place,
        excited_by="small and large displacements",
    )  # fmt: skip


model = Model(
    name="silverbox",
    sentence="a mass on a linear spring with linear damping",
    inputs={"force": "V"},
    outputs={"place": "V"},
    columns={"force": "input force as voltage", "place": "displacement as voltage"},
    nuisances=(
        Parameter(name="frequency", unit="Hz", value=70.0, lower=30.0, upper=150.0, typical=2.0, prior_sd=20.0),
        Parameter(name="damping", unit="1", value=0.05, lower=0.001, upper=0.5, typical=0.01, prior_sd=0.05),
        Parameter(name="gain", unit="1", value=1.0, lower=0.1, upper=10.0, typical=0.1, prior_sd=1.0),
        Parameter(name="offset", unit="V", lower=-0.1, upper=0.1, typical=0.001, prior_sd=0.02),
        Parameter(name="start", unit="V", typical=0.01, scope="window", guess=lambda window: window.at_start("place")),
        Parameter(name="start_speed", unit="V/s", typical=5.0, scope="window"),
    ),
    effects=(
        _spring(
            "spring that stiffens", "the spring's force grows with the cube of its travel", "... + w^2 k3 x^3", "spring",
            Parameter(name="cubic", unit="1/V^2", lower=-20.0, upper=20.0, typical=1.0),
        ),
        _spring(
            "spring that differs by direction", "the spring is stiffer to one side", "... + w^2 k2 x^2", "spring",
            Parameter(name="square", unit="1/V", lower=-5.0, upper=5.0, typical=0.1),
        ),
        _spring(
            "damping that grows with speed", "the damper's force grows with the square of the speed", "... + d |v| v", "damper",
            Parameter(name="drag", unit="1/V", lower=-20.0, upper=20.0, typical=1.0),
        ),
        *sensor_effects("place", "V", bias=0.01, kinds=("delay", "lag")),
    ),
    simulate=simulate,
    step_s=0.000819202,
    window_s=0.5,
)  # fmt: skip
