"""A ball dropped or thrown upwards in still air, filmed by a camera: the smallest model with missing physics.

Vertical motion, z up [m], first sample of each drop free in height and speed. Baseline: gravity alone.
Recording constants: mass [kg], diameter [m]. Sources: Morrison, An Introduction to Fluid Mechanics (2013), sphere drag
0.4-0.5 for 1e3 < Re < 2e5; added mass of a sphere is half the displaced mass (Lamb, Hydrodynamics, section 92).
"""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from discrepancy.model.description import Effect, Manoeuvre, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Array, Recording, signal

G = 9.81  # m/s²
AIR = 1.2  # kg/m³, 20 °C
VISCOSITY = 1.8e-5  # Pa s
STEP_S = 1.0 / 60.0
OUNCE_KG = 0.0283495


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """Height [m] by the classical Runge-Kutta method; forces up are positive."""
    mass, diameter = window.constants["mass"], window.constants["diameter"]
    displaced = AIR * np.pi * diameter**3 / 6.0
    square = 0.5 * AIR * np.pi / 4.0 * diameter**2 * values["drag_coefficient"]
    linear = 3.0 * np.pi * VISCOSITY * diameter * values["stokes"]
    weight = mass * G - values["buoyancy"] * displaced * G
    inertia = mass + values["added_mass"] * displaced
    forces = extra.get("force", np.zeros(window.time_s.size))
    z, v, h = values["height"], values["speed"], window.step_s
    heights, speeds = [z], [v]

    def acceleration(speed: float, force: float) -> float:
        return (-weight - square * speed * abs(speed) - linear * speed + force) / inertia

    for now, then in zip(forces[:-1].tolist(), forces[1:].tolist(), strict=True):
        k1 = acceleration(v, now)
        k2 = acceleration(v + 0.5 * h * k1, 0.5 * (now + then))
        k3 = acceleration(v + 0.5 * h * k2, 0.5 * (now + then))
        k4 = acceleration(v + h * k3, then)
        z += h * (v + h / 6.0 * (k1 + k2 + k3))
        v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        heights.append(z)
        speeds.append(v)
    # a late release: the same flight, shifted in time
    flight = np.maximum(window.time_s - values["release"], window.time_s[0])
    camera = 1.0 + values["pixel_scale"]
    return {
        "height": np.interp(flight, window.time_s, heights) * camera,
        "speed": np.interp(flight, window.time_s, speeds) * camera,
    }


def _first_height(window: Window) -> float:
    return window.at_start("height")


def _first_speed(window: Window) -> float:
    # mean speed of the first 0.3 s, and back to their beginning: half of that time under gravity
    early = window.time_s < window.time_s[0] + 0.3
    return float(np.polyfit(window.time_s[early], window["height"][early], 1)[0]) + 0.15 * G


NUISANCES = (
    Parameter(name="height", unit="m", typical=0.1, scope="window", guess=_first_height),
    Parameter(name="speed", unit="m/s", typical=0.1, scope="window", guess=_first_speed),
    # pixels to metres from the height of the bridge: a few per cent
    Parameter(name="pixel_scale", unit="1", lower=-0.2, upper=0.2, typical=0.02, prior_sd=0.03),
)
PHYSICS = (
    Effect(
        name="quadratic drag",
        sentence="the air resists in proportion to the square of the speed",
        equation="F = -1/2 rho cd (pi d²/4) v |v|",
        parameters=(Parameter(name="drag_coefficient", unit="1", lower=0.0, upper=2.0, typical=0.5),),
        kind="physics",
        place="force on the ball",
        excited_by="speeds near the terminal speed",
        confusable={
            "linear drag": "a wide range of speeds",
            "buoyancy": "a ball thrown upwards: drag changes sign",
        },
    ),
    Effect(
        name="linear drag",
        sentence="the air resists in proportion to the speed (creeping flow)",
        equation="F = -c 3 pi mu d v, c = 1 for a smooth sphere",
        parameters=(Parameter(name="stokes", unit="1", lower=0.0, upper=10.0, typical=1.0),),
        kind="physics",
        place="force on the ball",
        excited_by="a wide range of speeds",
        confusable={"quadratic drag": "a wide range of speeds"},
    ),
    Effect(
        name="buoyancy",
        sentence="the displaced air carries part of the weight",
        equation="F = c rho g pi d³/6, c = 1 for air alone",
        parameters=(Parameter(name="buoyancy", unit="1", lower=0.0, upper=3.0, typical=1.0),),
        kind="physics",
        place="force on the ball",
        confusable={"added mass": "a ball thrown upwards fast"},
    ),
    Effect(
        name="added mass",
        sentence="air is accelerated with the ball",
        equation="(m + c rho pi d³/6) a = F, c = 1/2 for a sphere",
        parameters=(Parameter(name="added_mass", unit="1", lower=0.0, upper=3.0, typical=0.5),),
        kind="physics",
        place="inertia of the ball",
        confusable={"buoyancy": "a ball thrown upwards fast"},
    ),
)
LAUNCH = Effect(
    name="late release",
    sentence="the ball is held for a time after the first sample",
    equation="z(t) = z0 until t0 + t_r",
    parameters=(
        Parameter(name="release", unit="s", lower=0.0, upper=0.4, typical=0.05, trial_steps=(0.05, 0.15)),
    ),
    kind="physics",
    place="start of each drop",
    excited_by="samples around the release",
)
CAMERA = sensor_effects("height", "m", bias=0.2, kinds=("lag",))
LIBRARY = (*PHYSICS, LAUNCH, *CAMERA)


def model(*, without: tuple[str, ...] = ()) -> Model:
    """The ball; `without` names effects to leave out of the library."""
    return Model(
        name="ball",
        sentence="a ball in free fall, seen by a camera",
        inputs={},
        outputs={"height": "m", "speed": "m/s"},
        constants={"mass": "kg", "diameter": "m"},
        nuisances=NUISANCES,
        effects=tuple(e for e in LIBRARY if e.name not in without),
        simulate=_with_defaults,
        step_s=STEP_S,
        ports=(Port(name="force", unit="N", typical=0.1, sentence="vertical force on the ball, up"),),
        manoeuvres=(
            _throw("thrown up", "throw the ball upwards at 15 m/s and film rise and fall", 10.0, 15.0, 3.5),
            _throw("dropped from twice the height", "drop it from 95 m", 95.0, 0.0, 4.4),
            _throw("thrown down", "throw the ball downwards at 20 m/s", 45.0, -20.0, 1.6),
        ),
    )


def _with_defaults(
    window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
) -> dict[str, Array]:
    off = {p.name: 0.0 for e in (*PHYSICS, LAUNCH) for p in e.parameters}
    return simulate(window, {**off, **values}, extra)


def _throw(name: str, sentence: str, height: float, speed: float, duration: float) -> Manoeuvre:
    return Manoeuvre(
        name=name, sentence=sentence, duration_s=duration, initial={"height": height, "speed": speed}
    )


# names in the table of drops -> names in the table of balls; 'Bowling Ball' is the lighter of two listed
WEIGHED = {
    "Baseball": "baseball",
    "Blue Basketball": "bluebasketball",
    "Green Basketball": "greenbasketball",
    "Bowling Ball": "bowlingball",
    "Golf Ball": "golfball",
    "Tennis Ball": "tennisball",
    "Whiffle Ball 1": "wiffleball1",
    "Whiffle Ball 2": "wiffleball2",
    "Yellow Whiffle Ball": "yellowWiffle",
    "Orange Whiffle Ball": "orangeWiffle",
}


def load_drops(folder: Path, ball: str) -> list[Recording]:
    """Both drops of one ball from ball_drops.csv and balls.txt (de Silva et al., arXiv:1906.07906, MIT)."""
    if ball not in WEIGHED:
        raise ValueError(f"ball {ball!r} has no known weight; known: {', '.join(WEIGHED)}")
    constants = _constants(folder / "balls.txt")[WEIGHED[ball]]
    with (folder / "ball_drops.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["ball"] == ball]
    drops = sorted({row["drop"] for row in rows})
    return [
        _drop(f"{ball}, drop {drop}", [r for r in rows if r["drop"] == drop], constants) for drop in drops
    ]


def _drop(name: str, rows: list[dict[str, str]], constants: Mapping[str, float]) -> Recording:
    time_s = [float(row["time_s"]) for row in rows]
    return Recording(name, {"height": signal(time_s, [float(r["height_m"]) for r in rows], "m")}, constants)


def _constants(path: Path) -> dict[str, dict[str, float]]:
    known = {}
    for line in path.read_text().splitlines()[1:]:
        name, weight, circumference = line.split()
        if weight != "??":
            diameter = float(circumference) / 100.0 / np.pi
            known[name] = {"mass": float(weight) * OUNCE_KG, "diameter": diameter}
    return known
