"""A room with a heater, a window and wind: several values of the sheet that one effect can put wrong."""

from collections.abc import Mapping

import numpy as np

from discrepancy.model.description import Model, Parameter, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Array, Recording, signal
from tests.discrepancy.toys import physics

SHEET = {
    "capacity": ("J/K", 3e4),
    "loss": ("W/K", 60.0),
    "vent": ("W/K", 80.0),
    "draught": ("W.s/(K.m)", 20.0),
}
KNOWN = 0.05  # standard deviation of each value of the sheet, as a share of it
STEP_S = 10.0
SAMPLES = 1440
NOISE = 0.05  # K


def warmed(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """C dx/dt = (1 - weak) P - (loss + leak + vent opening + draught wind) x, exact for what is held over a step."""
    lost = values["loss"] + values["vent"] * window["opening"] + values["draught"] * window["wind"]
    lost = lost + values.get("leak", 0.0)
    power = (1.0 - values.get("weak", 0.0)) * window["heater"]
    kept = np.exp(-lost / values["capacity"] * window.step_s)
    now, found = values["warm"], []
    for share, steady in zip(kept.tolist(), (power / lost).tolist(), strict=True):
        found.append(now)
        now = steady + share * (now - steady)
    return {"temperature": np.array(found)}


def room(*effects: str) -> Model:
    """A room; a weak heater is a larger capacity and larger losses, all by one factor, and a leak is a larger loss. effects: beside those of its thermometer."""
    known = [
        Parameter(name=name, unit=unit, value=value, lower=0.1 * value, upper=10.0 * value, typical=KNOWN * value, prior_sd=KNOWN * value)
        for name, (unit, value) in SHEET.items()
    ]  # fmt: skip
    share = Parameter(name="weak", unit="1", lower=0.0, upper=0.9, typical=0.1)
    open_by = Parameter(name="leak", unit="W/K", lower=0.0, upper=200.0, typical=10.0)
    library = (physics("weak heater", share, "heater"), physics("leak", open_by, "wall"))
    warm = Parameter(
        name="warm", unit="K", typical=1.0, scope="window", guess=lambda w: w.at_start("temperature")
    )
    return Model(
        name="room",
        sentence="a room",
        inputs={"heater": "W", "opening": "1", "wind": "m/s"},
        held=("heater", "opening", "wind"),
        outputs={"temperature": "K"},
        nuisances=(*known, warm),
        effects=(
            *(e for e in library if e.name in effects),
            *sensor_effects("temperature", "K", bias=1.0, kinds=("bias", "delay")),
        ),
        simulate=warmed,
        step_s=STEP_S,
        window_s=1200.0,
    )


def evening(
    seed: int,
    *,
    weak: float = 0.0,
    bias: float = 0.0,
    leak: float = 0.0,
    leak_from: int = 0,
    off: float = 0.0,
) -> Recording:
    """Four hours; the leak opens at this sample. off: standard deviation by which the sheet is wrong, as a share of each value."""
    rng, n = np.random.default_rng(seed), SAMPLES
    time_s = STEP_S * np.arange(n)

    def steps(low: float, high: float, every: int) -> Array:
        return np.repeat(rng.uniform(low, high, n // every + 1), every)[:n]

    signals = {
        "heater": signal(time_s, steps(0.0, 2000.0, 30), "W", held=True),
        "opening": signal(time_s, steps(0.0, 1.0, 47), "1", held=True),
        "wind": signal(time_s, steps(0.0, 5.0, 22), "m/s", held=True),
    }
    real = {name: value * (1.0 + off * rng.normal()) for name, (_, value) in SHEET.items()}
    true, warm = list[float](), 8.0
    # up to the sample at which the leak opens, that one included, and on from there
    for first, stop, open_leak in ((0, leak_from + 1, 0.0), (leak_from, n, leak)):
        part = Window(
            recording="evening",
            start_s=float(time_s[first]),
            end_s=float(time_s[stop - 1]),
            time_s=time_s[first:stop],
            step_s=STEP_S,
            known={name: s.value[first:stop] for name, s in signals.items()},
            constants={},
        )
        found = warmed(part, {**real, "weak": weak, "leak": open_leak, "warm": warm}, {})["temperature"]
        true[first:] = found.tolist()
        warm = float(found[-1])
    seen = np.array(true) + bias + NOISE * rng.normal(size=n)
    return Recording("evening", {**signals, "temperature": signal(time_s, seen, "K")})
