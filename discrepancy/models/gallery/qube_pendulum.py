"""The arm of a rotary pendulum that a controller keeps upright: a recording of Quanser's Qube by Dahdah and Forbes (2023), 250 Hz."""

import math
from collections.abc import Mapping
from typing import Any

import numba
import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

CREEP_RAD_S = 0.05  # speed within which the direction of dry friction is not certain


def _turned(
    push: Array, h: float, swing: Array, damping: float, dry: float, cable: float, angle: float, speed: float
) -> Array:
    """swing: what the pendulum's own acceleration adds to the arm's speed."""
    angles = np.empty(push.size)
    for i, pushed in enumerate(push):
        angles[i] = angle
        before = speed
        speed += h * (pushed - damping * speed - dry * math.tanh(speed / CREEP_RAD_S) - cable * angle)
        if i + 1 < push.size:
            speed += swing[i + 1] - swing[i]
        angle += 0.5 * h * (before + speed)
    return angles


_compiled: Any = numba.njit(_turned)


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    volts, lean = window["voltage"] + extra.get("voltage", 0.0), window["pendulum"]
    dead = values.get("dead", 0.0)
    volts = volts - values.get("offset", 0.0) - np.clip(volts, -dead, dead)
    push = values["push"] * volts + values["lean"] * lean
    swing = -values["coupling"] * np.gradient(lean, window.step_s)
    resisted = values["damping"], values.get("dry", 0.0), values.get("cable", 0.0)
    return {"arm": _compiled(push, window.step_s, swing, *resisted, values["start"], values["start_speed"])}


def _effect(
    name: str, sentence: str, equation: str, place: str, excited_by: str, parameter: Parameter
) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=(parameter,), kind="physics", place=place,
        excited_by=excited_by,
    )  # fmt: skip


model = Model(
    name="qube pendulum",
    sentence="an arm that a motor turns and a pendulum pushes, with linear damping",
    inputs={"voltage": "V", "pendulum": "rad"},
    held=("voltage",),
    outputs={"arm": "rad"},
    columns={"voltage": "motor voltage", "pendulum": "pendulum angle", "arm": "arm angle"},
    nuisances=(
        Parameter(name="push", unit="rad/(s^2.V)", value=50.0, lower=1.0, upper=500.0, typical=5.0, prior_sd=50.0),
        Parameter(name="damping", unit="1/s", value=10.0, lower=0.0, upper=100.0, typical=1.0, prior_sd=10.0),
        Parameter(name="lean", unit="1/s^2", value=0.0, lower=-500.0, upper=500.0, typical=10.0, prior_sd=100.0),
        Parameter(name="coupling", unit="1", value=0.2, lower=-2.0, upper=2.0, typical=0.02, prior_sd=0.5),
        Parameter(name="start", unit="rad", typical=0.01, scope="window", guess=lambda window: window.at_start("arm")),
        Parameter(name="start_speed", unit="rad/s", typical=0.5, scope="window"),
    ),
    effects=(
        _effect(
            "dry friction", "the arm resists with a constant torque", "... - c sign(w)", "bearing and brushes", "both directions",
            Parameter(name="dry", unit="rad/s^2", lower=0.0, upper=100.0, typical=5.0),
        ),
        _effect(
            "dead zone of the motor", "small voltages do not turn the motor", "u - clip(u, -d, d)", "motor", "small voltages",
            Parameter(name="dead", unit="V", lower=0.0, upper=2.0, typical=0.1),
        ),
        _effect(
            "offset of the voltage", "the motor's voltage is off by a constant", "u - u0", "amplifier", "any drive",
            Parameter(name="offset", unit="V", lower=-2.0, upper=2.0, typical=0.05),
        ),
        _effect(
            "cable of the encoder", "the cable pulls the arm back", "... - k angle", "cable", "large angles",
            Parameter(name="cable", unit="1/s^2", lower=0.0, upper=100.0, typical=5.0),
        ),
        *sensor_effects("arm", "rad", bias=0.01, kinds=("delay",)),
    ),
    simulate=simulate,
    step_s=0.002,
    window_s=1.0,
)  # fmt: skip
