"""Two tanks, one above the other, filled by a pump: the benchmark of Schoukens, Mattsson, Wigren and Noel (2016), 4 s between samples.

Levels are read in volts, as published.
"""

import math
from collections.abc import Mapping

import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

RIM_V = 10.0  # level of a full tank, and the end of the sensor's range


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    upper, lower = values["start_upper"], values["start_lower"]
    spill, caught = values.get("spill", 0.0), values.get("caught", 0.0)
    level = np.empty(window.time_s.size)
    h = window.step_s
    for i, pumped in enumerate(window["pump"]):
        level[i] = lower
        drained = values["drain_upper"] * math.sqrt(max(upper, 0.0))
        over = max(upper - RIM_V, 0.0)
        upper += h * (values["pump_rate"] * pumped - drained - spill * over)
        lower += h * (
            values["coupling"] * drained - values["drain_lower"] * math.sqrt(max(lower, 0.0)) + caught * over
        )
    return {"level": level - values.get("clipped", 0.0) * np.maximum(level - RIM_V, 0.0)}


def _effect(
    name: str, sentence: str, equation: str, place: str, *parameters: Parameter, kind: str = "physics"
) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=parameters, kind=kind, place=place,  # type: ignore[arg-type]
        excited_by="a full tank",
    )  # fmt: skip


def _rate(name: str, unit: str, value: float) -> Parameter:
    return Parameter(
        name=name,
        unit=unit,
        value=value,
        lower=0.2 * value,
        upper=5.0 * value,
        typical=0.1 * value,
        prior_sd=value,
    )


model = Model(
    name="cascaded tanks",
    sentence="two tanks that drain by Torricelli's law",
    inputs={"pump": "V"},
    held=("pump",),
    outputs={"level": "V"},
    columns={"pump": "pump voltage", "level": "lower tank level"},
    nuisances=(
        _rate("pump_rate", "1/s", 0.05),
        Parameter(name="drain_upper", unit="1/s", value=0.06, lower=0.01, upper=0.3, typical=0.006, prior_sd=0.06),
        Parameter(name="drain_lower", unit="1/s", value=0.06, lower=0.01, upper=0.3, typical=0.006, prior_sd=0.06),
        Parameter(name="coupling", unit="1", value=1.0, lower=0.2, upper=5.0, typical=0.1, prior_sd=0.5),
        Parameter(name="start_upper", unit="V", value=5.0, lower=0.0, upper=15.0, typical=0.5, scope="window"),
        Parameter(
            name="start_lower", unit="V", lower=0.0, upper=11.0, typical=0.2, scope="window",
            guess=lambda window: window.at_start("level"),
        ),
    ),
    effects=(
        _effect(
            "overflow", "water leaves the upper tank over its rim", "dx1/dt = ... - s max(x1 - 10 V, 0)", "upper tank",
            Parameter(name="spill", unit="1/s", lower=0.0, upper=0.5, typical=0.05),
        ),
        _effect(
            "overflow into the lower tank", "water over the rim of the upper tank falls into the lower one",
            "dx2/dt = ... + c max(x1 - 10 V, 0)", "lower tank",
            Parameter(name="caught", unit="1/s", lower=0.0, upper=0.5, typical=0.02),
        ),
        _effect(
            "saturated reading", "the sensor reads no more than 10 V", "y = x2 - c max(x2 - 10 V, 0)", "sensor of level",
            Parameter(name="clipped", unit="1", lower=0.0, upper=1.0, typical=0.5), kind="sensor",
        ),
        *sensor_effects("level", "V", bias=0.1, kinds=("scale", "lag")),
    ),
    simulate=simulate,
    step_s=1.0,
    window_s=1000.0,
)  # fmt: skip
