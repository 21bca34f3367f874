"""Wild arms of the whole loader: laws and sensor vices that the model lacks, beside what is hidden.

The laws are effects of the plant in files of their own (`bench/wild_effects`), which the model is not given, and those of the library
that are not searched. The vices of sensors are put into the recording after it was read. Needs the
environment variable LOADERHIL_EFFECTS=bench/wild_effects, because the plant compiles all effects that exist.
"""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from bench import loader_truth
from bench.proof import oracle
from bench.proof.arm import Arm, Truth, diagnosed
from bench.proof.difference import Difference, drawn, names
from diagnosis.fleet.store import Row
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model
from discrepancy.models.loader import model as loader
from discrepancy.signals.recording import Recording, Signal
from plant.effects import effects as plant_effects

BODY = "wild loader"
OWN = ("stribeck_rolling", "root_drag", "cornering_law", "rough_ground")
"""The laws in bench/wild_effects."""
LATE = ("pitch_angle", "roll_angle", "lift_pressure", "tilt_pressure")
"""Channels of a second logger."""
SCALES = (1.0, 3.0)  # of an effect's typical change
NULLS, TWINS = 18, 4
PAIRS = (
    ("rolling_resistance", "yaw_rate delay"),
    ("payload_mass", "specific_force_x scale"),
    ("tyre_wear", "lift_pressure scale"),
    ("surface_friction", "pitch_angle delay"),
)
DIFFERENCES = (
    Difference(
        name="rolling friction that falls with speed",
        ranges={"stribeck_rolling.coefficient": (0.005, 0.02), "stribeck_rolling.decay_m_per_s": (0.5, 2.0)},
        fair=("rolling_resistance", "brake_drag", "resistance_curve"),
    ),
    Difference(
        name="resistance of another power",
        ranges={"root_drag.force_N": (300.0, 1500.0), "root_drag.power": (0.3, 0.7)},
        fair=("rolling_resistance", "brake_drag", "aerodynamic_drag", "resistance_curve"),
    ),
    Difference(
        name="cornering by another law",
        ranges={"cornering_law.share": (0.05, 0.3), "cornering_law.slip": (0.02, 0.1)},
        # it acts on the slip that the carcass lets through, so a stiffer tyre is a stiffer carcass, which is a shorter relaxation
        fair=(
            "cornering_curve",
            "lateral_relaxation",
            "surface_friction",
            "velocity_dependent_friction",
            "inflation_pressure",
            "turn_slip",
        ),
    ),
    Difference(
        name="rough ground",
        ranges={"rough_ground.amplitude_mm": (3.0, 15.0), "rough_ground.phase_per_m": (0.5, 2.0)},
        fair=("washboard",),
    ),
    Difference(
        name="kerb",
        ranges={
            "kerb.distance_m": (10.0, 40.0),
            "kerb.length_m": (0.3, 0.6),
            "kerb.left_m": (0.02, 0.08),
            "kerb.right_m": (0.02, 0.08),
        },
    ),
    Difference(name="seals that stick", ranges={"seals": (5e4, 3e5)}, fair=("lift_pressure bias",)),
    Difference(
        name="gyro that feels forces", ranges={"g_sensitivity": (0.002, 0.01)}, fair=("yaw_rate scale",)
    ),
    Difference(
        name="wandering acceleration", ranges={"wander": (0.01, 0.05)}, fair=("specific_force_x bias",)
    ),
    Difference(
        name="clock drift",
        ranges={"drift": (5e-5, 3e-4)},
        fair=tuple(f"{name} {kind}" for name in LATE for kind in ("delay", "lag")),
    ),
    Difference(name="outliers", ranges={"outliers": (0.001, 0.005)}),
)


def arms(first_seed: int) -> Iterator[Arm]:
    """Some 60: nothing hidden, one effect, a pair, and an effect that has an exact twin in the library."""

    def arm(kind: str, seed: int, effects: tuple[str, ...] = (), strength: float = 0.0) -> Arm:
        what = names(DIFFERENCES, seed, effects) if kind != "twin" else ""
        return Arm(body=BODY, kind=kind, seed=seed, effects=effects, strength=strength, what=what)

    for number in range(NULLS):
        yield arm("null", first_seed + number)
    single = [name for name in loader_truth.REPORT_EFFECTS if name not in ("aerodynamic_drag", "mass_split")]
    for place, name in enumerate(single[::1]):
        yield arm("effect", first_seed + 1_000 + place, (name,), SCALES[place % len(SCALES)])
    for place, name in enumerate(single[::2]):
        yield arm("effect", first_seed + 1_500 + place, (name,), SCALES[1 - place % len(SCALES)])
    for place, pair in enumerate(PAIRS):
        yield arm("pair", first_seed + 2_000 + place, pair, 1.0)
    for place in range(TWINS):
        physics = [name for name in single if " " not in name]
        yield arm("twin", first_seed + 3_000 + place, (physics[2 * place],), 1.0)


def carried_out(arm: Arm, twinned) -> Row:
    """Record without the differences to say how strong the effect is, record with them, diagnose.

    twinned: makes a model whose library has an effect twice.
    """
    if missing := set(OWN) - set(plant_effects()):
        raise ValueError(f"no effect {min(missing)}: set LOADERHIL_EFFECTS=bench/wild_effects")
    extra = drawn(arm, DIFFERENCES)
    beside = {name: value for name, value in extra.items() if "." in name}
    drive = loader_truth.Arm(effects=arm.effects, seed=arm.seed, scale=arm.strength or 1.0)
    recording, values = _recorded(replace(drive, beside=beside))
    recording = spoilt(recording, extra, np.random.default_rng([arm.seed, 7]))
    model = loader.model([recording], without=OWN)
    truth = Truth(values={**values, **extra})
    if arm.effects:
        tame, known = _recorded(drive)
        without = _measured(arm, loader.model([tame], without=OWN), tame, known)
        truth = replace(
            truth, reached=without.reached, beside=_measured(arm, model, recording, values).reached
        )
    if arm.kind == "twin":
        model = twinned(model, model.effect(arm.effects[0]))
    return diagnosed(arm, model, [recording], truth)


def _recorded(drive: loader_truth.Arm) -> tuple[Recording, dict[str, float]]:
    with tempfile.TemporaryDirectory(prefix="loaderhil-wild-") as folder:
        run = Path(folder) / "run"
        values = loader_truth.record(drive, run)
        return loader.load_run(run), values


def _measured(arm: Arm, model: Model, recording: Recording, values: Mapping[str, float]) -> Truth:
    """How visible what is hidden is in a recording; nothing else is a candidate."""
    effects = tuple(model.effect(name) for name in arm.effects)
    hidden = {p.name: values[p.name] for effect in effects for p in effect.parameters}
    return oracle.measured(Problem(replace(model, effects=effects), [recording]), effects, hidden)


def spoilt(recording: Recording, extra: Mapping[str, float], rng: np.random.Generator) -> Recording:
    """What real sensors add, put into the recording."""
    signals = dict(recording.signals)

    def changed(name: str, value: np.ndarray) -> None:
        signals[name] = replace(signals[name], value=value)

    if "seals" in extra:
        arm, pressure = signals["lift_arm_angle"], signals["lift_pressure"]
        rate = np.gradient(arm.value, arm.time_s)
        moving = np.tanh(np.interp(pressure.time_s, arm.time_s, rate) / 0.02)
        changed("lift_pressure", pressure.value + extra["seals"] * moving)
    if "g_sensitivity" in extra:
        for axis in ("roll", "pitch", "yaw"):
            gyro, side = signals[f"{axis}_rate"], signals["specific_force_y"]
            felt = np.interp(gyro.time_s, side.time_s, side.value)
            changed(f"{axis}_rate", gyro.value + extra["g_sensitivity"] * felt)
    if "wander" in extra:
        ahead = signals["specific_force_x"]
        a = np.exp(-float(np.median(np.diff(ahead.time_s))) / 5.0)
        walk = rng.normal(0.0, extra["wander"], ahead.value.size)
        changed("specific_force_x", ahead.value + lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], walk))
    if "drift" in extra:
        for name in LATE:
            signals[name] = _drifted(signals[name], extra["drift"])
    if "outliers" in extra:
        for name in ("wheel_speed_front_left", "yaw_rate", "specific_force_z"):
            good = signals[name]
            wrong = rng.random(good.value.size) < extra["outliers"]
            size = 20.0 * float(np.std(np.diff(good.value)))
            changed(name, np.where(wrong, good.value + rng.normal(0.0, size, good.value.size), good.value))
    return replace(recording, signals=signals)


def _drifted(good: Signal, drift: float) -> Signal:
    begin = good.time_s[0]
    return replace(good, time_s=begin + (good.time_s - begin) * (1.0 + drift))
