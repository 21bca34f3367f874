"""A tank that fills: the smallest model for laws of the engine. dx/dt = u / area - leak x, measured with noise."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from discrepancy.model.description import Effect, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Array, Recording, signal

STEP_S = 0.1


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    inflow = window["inflow"] / values["area"] + extra.get("inflow", 0.0)
    rate = 0.2 + values.get("leak", 0.0)
    a = np.exp(-rate * window.step_s)  # exact for an inflow that is held over a step
    moved = lfilter([0.0, (1.0 - a) / rate], [1.0, -a], inflow, zi=[values["level"]])[0]
    return {"level": moved + values.get("offset", 0.0)}


def physics(name: str, parameter: Parameter, place: str = "tank") -> Effect:
    """An effect of one parameter."""
    return Effect(
        name=name,
        sentence=name,
        equation="",
        parameters=(parameter,),
        kind="physics",
        place=place,
        excited_by="filling",
    )


def tank(*effects: str) -> Model:
    library = (
        physics("leak", Parameter(name="leak", unit="1/s", lower=0.0, upper=1.0, typical=0.05)),
        # the same column as the sensor's bias: an exact twin
        physics("offset", Parameter(name="offset", unit="m", lower=-2.0, upper=2.0, typical=0.1)),
        *sensor_effects("level", "m", bias=0.1, kinds=("bias", "scale", "delay", "lag", "sign")),
    )
    return Model(
        name="tank",
        sentence="a tank that fills and drains",
        inputs={"inflow": "m/s"},
        held=("inflow",),
        outputs={"level": "m"},
        nuisances=(
            Parameter(name="area", unit="1", value=1.0, lower=0.5, upper=2.0, typical=0.05, prior_sd=0.02),
            Parameter(
                name="level", unit="m", typical=0.1, scope="window", guess=lambda w: w.at_start("level")
            ),
        ),
        effects=tuple(e for e in library if not effects or e.name in effects),
        simulate=simulate,
        step_s=STEP_S,
        window_s=20.0,
        ports=(Port(name="inflow", unit="m/s", typical=0.1, sentence="inflow beyond the measured one"),),
    )


def record(
    seed: int,
    *,
    noise: float = 0.02,
    leak: float = 0.0,
    bias: float = 0.0,
    delay_s: float = 0.0,
    lag_s: float = 0.0,
    sign: float = 1.0,
    square: float = 0.0,
    memory: float = 0.0,
    pump_lag_s: float = 0.0,
    duration_s: float = 120.0,
) -> Recording:
    """Truth at a tenth of the model's step, so the fit never uses the integrator that made the data."""
    rng = np.random.default_rng(seed)
    fine = 10
    n = int(duration_s / STEP_S)
    inflow = np.repeat(np.repeat(rng.uniform(-0.5, 1.0, n // 25 + 1), 25)[:n], fine)
    h, level, out = STEP_S / fine, 0.5, np.empty(n * fine)
    pumped = inflow
    if pump_lag_s:  # the pump follows its command by a lag
        a = np.exp(-h / pump_lag_s)
        pumped = lfilter([1.0 - a], [1.0, -a], inflow, zi=[a * inflow[0]])[0]
    for i, u in enumerate(pumped.tolist()):
        out[i] = level
        level += h * (u - (0.2 + leak) * level - square * level * abs(level))
    time_s = h * np.arange(n * fine)
    if lag_s:
        a = np.exp(-h / lag_s)
        out = lfilter([1.0 - a], [1.0, -a], out, zi=[a * out[0]])[0]
    seen = sign * np.interp(time_s - delay_s, time_s, out)[::fine] + bias
    white = rng.normal(0.0, noise, n)
    colour = lfilter([1.0], [1.0, -memory], white) if memory else white
    return Recording(
        "tank",
        {
            "inflow": signal(time_s[::fine], inflow[::fine], "m/s", held=True),
            "level": signal(time_s[::fine], seen + colour, "m"),
        },
    )


def struck(recording: Recording, start_s: float, end_s: float, size: float) -> Recording:
    """The level reads too much by a slow swing for some time, which no effect of the library is."""
    level = recording.signals["level"]
    inside = (level.time_s >= start_s) & (level.time_s < end_s)
    swing = size * np.sin(2.0 * np.pi * (level.time_s - start_s) / (end_s - start_s)) * inside
    return replace(
        recording, signals={**recording.signals, "level": replace(level, value=level.value + swing)}
    )
