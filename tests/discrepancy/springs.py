"""A spring whose force is recorded: it may be stiffer than its sheet says, or stiffen with the way. At one amplitude both are the same."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discrepancy.model import Array, Effect, Manoeuvre, Model, Parameter, Recording, Signal, Window, signal

STEP_S = 0.05
STIFFNESS = 10.0  # N/m


def _simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
    x = window["way"]
    stiffness = STIFFNESS + values.get("stiffer", 0.0)
    return {"force": values["preload"] + stiffness * x + values.get("cubic", 0.0) * x**3}


def _effect(name: str, unit: str) -> Effect:
    return Effect(
        name=name,
        sentence=f"the spring is {name}",
        equation="",
        parameters=(Parameter(name=name, unit=unit, lower=-5.0, upper=5.0, typical=0.5),),
        kind="physics",
        place="spring",
    )


def steps(amplitude: float, duration_s: float) -> Signal:
    """A square wave of the way, in metres."""
    time_s = STEP_S * np.arange(int(duration_s / STEP_S) + 1)
    return signal(time_s, amplitude * np.sign(np.sin(time_s) + 1e-9), "m")


def stretching(name: str, amplitude: float, duration_s: float) -> Manoeuvre:
    return Manoeuvre(
        name=name,
        sentence=f"Stretch the spring by {amplitude:g} m and back.",
        duration_s=duration_s,
        inputs={"way": steps(amplitude, duration_s)},
    )


MANOEUVRES = (
    stretching("the same again", 1.0, 10.0),
    stretching("further", 2.0, 20.0),
    stretching("further and longer", 2.0, 60.0),
)


def spring(manoeuvres: tuple[Manoeuvre, ...] = MANOEUVRES) -> Model:
    return Model(
        name="spring",
        sentence="a spring",
        inputs={"way": "m"},
        outputs={"force": "N"},
        nuisances=(Parameter(name="preload", unit="N", typical=0.1, prior_sd=0.2),),
        effects=(_effect("stiffer", "N/m"), _effect("cubic", "N/m^3")),
        simulate=_simulate,
        step_s=STEP_S,
        window_s=10.0,
        manoeuvres=manoeuvres,
    )


def stretched(
    seed: int, *, amplitude: float = 1.0, duration_s: float = 40.0, noise: float = 0.2, **effects: float
) -> Recording:
    """The force of a spring with these effects."""
    way = steps(amplitude, duration_s)
    rng = np.random.default_rng(seed)
    true = (STIFFNESS + effects.get("stiffer", 0.0)) * way.value + effects.get("cubic", 0.0) * way.value**3
    force = signal(way.time_s, true + rng.normal(0.0, noise, true.size), "N")
    return Recording(f"at {amplitude:g} m", {"way": replace(way), "force": force})
