"""A wheel loader driving straight, forwards and backwards, as one mass: the benchmark of the engine.

Speed + forwards [m/s]; forces at the ground [N]. The driver closes the loop through the measured speed, so noise and inputs
are correlated. Integrated by exponential midpoint steps of 5 ms; the
benchmark's truth uses another method.
Sources of the effects: Gillespie (SAE 1992) chapters 1 and 4; typical values of a 12 t loader.
"""

import math
from collections.abc import Callable, Mapping
from typing import TypeVar

import numba
import numpy as np
from scipy.signal import lfilter

from discrepancy.model.description import Effect, Manoeuvre, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Array, signal

G = 9.81
MASS_KG = 11_840.0
STEP_S = 0.01
SUBSTEPS = 2  # integration steps per grid step
CORNER_M_S = 0.05  # speed below which friction and brakes fade out instead of switching


F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """numba.njit that keeps the signature."""
    made: F = numba.njit(function)
    return made


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """Speed and specific force on the grid."""
    drive = lagged_mean(window["drive_force"], values.get("motor_lag", 0.0), window.step_s)
    drive = drive * (1.0 - values.get("drive_loss", 0.0))
    push = drive - values["mass"] * G * np.sin(values.get("slope", 0.0)) + extra.get("force", 0.0)
    brake = window["brake_force"] * (1.0 - values.get("brake_fade", 0.0))
    resist = values["mass"] * G * values.get("rolling", 0.0)
    coefficients = np.array(
        [values["mass"], values["viscous"], values.get("square", 0.0), values.get("reverse", 0.0), resist]
    )
    speed = integrate(push, brake, coefficients, values["speed"], window.step_s)
    acceleration = _averaged_slope(speed, window.step_s)
    force = acceleration + G * np.sin(values.get("slope", 0.0))
    # a wheel is read before the command with the same stamp acts, so slip follows the command of the step before
    traction = np.concatenate((drive[:1], drive[:-1]))
    return {
        "speed": speed * (1.0 + values.get("slip", 0.0) * traction / (values["mass"] * G)),
        "acceleration": force,
    }


def _averaged_slope(speed: Array, step_s: float) -> Array:
    """Mean acceleration over the 10 ms that begin at each stamp, which is what the accelerometer gives."""
    n = max(1, round(STEP_S / step_s))
    later = np.concatenate((speed[n:], speed[-1] + (speed[-1] - speed[-2]) * np.arange(1, n + 1)))
    return (later - speed) / (n * step_s)


def lagged_mean(command: Array, time_constant_s: float, step_s: float) -> Array:
    """Mean over each step of a first-order lag of a command that is held over it; starts settled."""
    if time_constant_s < 1e-9:
        return command
    a = math.exp(-step_s / time_constant_s)
    past = np.concatenate((command[:1], command[:-1]))
    at_stamp = np.asarray(lfilter([1.0 - a], [1.0, -a], past, zi=[a * command[0]])[0], float)
    return command + (at_stamp - command) * (time_constant_s / step_s) * (1.0 - a)


@compiled
def _resistance(v: float, friction: float, viscous: float, square: float, reverse: float) -> float:
    """Resistance as force per speed [kg/s]; never zero, since the exponential step divides by it."""
    drag = viscous + square * abs(v) + (reverse if v < 0.0 else 0.0)
    return drag + friction / math.sqrt(v * v + CORNER_M_S**2) + 1e-6


@compiled
def integrate(push: Array, brake: Array, coefficients: Array, start: float, step: float) -> Array:
    """Speed [m/s] (n,) under push [N] and resistances."""
    # Resistances are treated as a force per speed (implicitly): the speed then decays to zero and never crosses it, so that stopping needs
    # no event detection.
    mass, viscous, square, reverse, resist = coefficients
    speed = np.empty(push.size)
    v = start
    h = step / SUBSTEPS
    for i in range(push.size):
        speed[i] = v
        for _ in range(SUBSTEPS):
            # exponential midpoint rule: a half step gives the speed in the middle, whose resistance is used for the whole step
            a = _resistance(v, brake[i] + resist, viscous, square, reverse) / mass
            middle = v + (push[i] / mass - a * v) * (1.0 - math.exp(-0.5 * a * h)) / a
            a = _resistance(middle, brake[i] + resist, viscous, square, reverse) / mass
            v = v + (push[i] / mass - a * v) * (1.0 - math.exp(-a * h)) / a
    return speed


def _effect(
    name: str, sentence: str, equation: str, parameter: Parameter, place: str, excited: str, **confusable: str
) -> Effect:
    return Effect(
        name=name,
        sentence=sentence,
        equation=equation,
        parameters=(parameter,),
        kind="physics",
        place=place,
        excited_by=excited,
        confusable={other.replace("_", " "): how for other, how in confusable.items()},
    )


def _parameter(name: str, unit: str, lower: float, upper: float, typical: float) -> Parameter:
    return Parameter(name=name, unit=unit, lower=lower, upper=upper, typical=typical)


REVERSE = "drive the same road in the other direction"
LIBRARY = (
    _effect(
        "rolling resistance",
        "the tyres resist with a force that only depends on the direction of travel",
        "F = -f m g sign(v)",
        Parameter(name="rolling", unit="1", lower=0.0, upper=0.2, typical=0.015, trial_steps=(0.015, 0.004)),
        "wheels",
        "driving in both directions",
        slope=REVERSE,
        reverse_drag="several speeds backwards",
    ),
    _effect(
        "slope",
        "the ground climbs",
        "F = -m g sin(theta), and the accelerometer reads g sin(theta) more",
        _parameter("slope", "rad", -0.2, 0.2, 0.01),
        "gravity along the path",
        "any driving",
        rolling_resistance=REVERSE,
        acceleration_bias="standstill on level ground",
    ),
    _effect(
        "quadratic drag",
        "resistance grows with the square of speed",
        "F = -k v |v|",
        _parameter("square", "kg/m", 0.0, 500.0, 30.0),
        "whole machine",
        "a wide range of speeds",
        rolling_resistance="a wide range of speeds",
    ),
    _effect(
        "reverse drag",
        "the driveline drags when driving backwards",
        "F = -c v for v < 0",
        _parameter("reverse", "kg/s", 0.0, 5000.0, 200.0),
        "driveline",
        "driving backwards",
        slope=REVERSE,
    ),
    _effect(
        "brake fade",
        "the brakes deliver less than demanded",
        "F_brake = (1 - b) F_demanded",
        _parameter("brake_fade", "1", 0.0, 0.9, 0.1),
        "brakes",
        "braking",
    ),
    _effect(
        "motor lag",
        "the drive force follows its command with a first-order lag",
        "tau dF/dt + F = F_command",
        Parameter(name="motor_lag", unit="s", lower=0.0, upper=2.0, typical=0.1, trial_steps=(0.1, 0.4)),
        "drive",
        "fast changes of the command",
        speed_delay="a step of the command: acceleration is late too under a lag",
    ),
    _effect(
        "drive loss",
        "the drive delivers less than commanded",
        "F = (1 - e) F_command",
        _parameter("drive_loss", "1", 0.0, 0.5, 0.05),
        "drive",
        "accelerating and braking",
        brake_fade="brake without drive, drive without brake",
    ),
    _effect(
        "wheel slip",
        "the wheels turn faster than the machine under traction",
        "v_wheel = v (1 + c F / (m g))",
        _parameter("slip", "1", 0.0, 1.0, 0.1),
        "contact of tyre and ground",
        "strong traction at speed",
    ),
    *sensor_effects("speed", "m/s", bias=0.05, kinds=("scale", "delay"), delay_s=0.04),
    *sensor_effects("acceleration", "m/s^2", bias=0.05, kinds=("bias", "scale")),
)


def _first_speed(window: Window) -> float:
    return window.at_start("speed")


def model(*, without: tuple[str, ...] = ()) -> Model:
    """The model; `without` names effects to leave out of the library."""
    return Model(
        name="straight",
        sentence="a wheel loader driving straight",
        inputs={"drive_force": "N", "brake_force": "N"},
        held=("drive_force", "brake_force"),
        outputs={"speed": "m/s", "acceleration": "m/s^2"},
        nuisances=(
            Parameter(
                name="mass",
                unit="kg",
                value=MASS_KG,
                lower=8e3,
                upper=2e4,
                typical=500.0,
                prior_sd=0.03 * MASS_KG,
            ),
            Parameter(
                name="viscous",
                unit="kg/s",
                value=400.0,
                lower=0.0,
                upper=3000.0,
                typical=100.0,
                prior_sd=200.0,
            ),
            Parameter(name="speed", unit="m/s", typical=0.1, scope="window", guess=_first_speed),
        ),
        effects=tuple(e for e in LIBRARY if e.name not in without),
        simulate=simulate,
        step_s=STEP_S,
        window_s=8.0,
        lead_s=1.0,
        ports=(Port(name="force", unit="N", typical=500.0, sentence="force on the machine, forwards"),),
        manoeuvres=(_shuttle(),),
    )


def _shuttle() -> Manoeuvre:
    time_s = np.arange(0.0, 30.0, STEP_S)
    force = np.where(np.sin(2 * np.pi * time_s / 15.0) > 0, 12e3, -12e3) * (
        np.cos(2 * np.pi * time_s / 6.0) > -0.3
    )
    return Manoeuvre(
        name="shuttle",
        sentence="shuttle forwards and backwards with steps of full drive, coasting in between",
        duration_s=30.0,
        inputs={
            "drive_force": signal(time_s, force, "N", held=True),
            "brake_force": signal(time_s, np.zeros(time_s.size), "N", held=True),
        },
        initial={"speed": 0.5},
    )
