"""Raw recordings of a chassis dynamometer, made from the plant's tyre with the protocol and the defects of the thesis.

The wheel's speed follows an engine through a torque converter: slip grows with the cube of the throttle, and a step of the
cylinder's speed is not a step of slip.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identify.make.defects import RIG, Defects, dropped, ringing, spiked
from identify.make.drum import drum_force, wheel_block
from identify.rig.log import PistonCalibration, RigLog, RigRun
from identify.tyre.parameters import COMBINED, Nominal
from identify.tyre.patch import deflection
from plant.sheets.machine import Machine

Array = NDArray[np.float64]

RATE_HZ = 500.0
FINER = 4  # steps of the truth in one sample
BAR, KMH = 1e5, 1.0 / 3.6
SCALE_M = 2.0 * np.pi * 0.72 / 20.3  # road per turn of the cardan shaft
STEP_SLIPS = (0.006, 0.012, 0.025, 0.05, 0.1)  # of the cylinder speeds 5, 4, 3, 2, 1 km/h
VALIDATION_SLIPS = (0.0, 0.012, 0.03, 0.07, 0.16, 0.4, 1.1)
OFFSET, SLOPE = (
    29.0 / 34.0,
    4.80 / 34.0,
)  # load over the nominal one: at 0 bar, per bar of the piston [T table 8]


@dataclass(frozen=True, slots=True, kw_only=True)
class RigTruth:
    """What a rig's log hides."""

    tyre: dict[str, float]
    carcass_stiffness: float  # [N/m] at nominal pressure
    scale: float  # [m] road per turn of the shaft
    gain: float
    loads: dict[str, float]  # true load of each run [N]
    tares: dict[str, float]  # [N]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is driven. Pressures [bar]; repeats of every drive and brake run."""

    piston_bar: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0)
    inflation_bar: tuple[float, ...] = (2.0, 5.0)  # beside the nominal one, at the first piston pressure
    repeats: int = 2
    steps_bar: tuple[float, ...] = (1.0, 3.0)
    validation: bool = True


OF_PLANT = (
    "PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX3", "PEX4", "PKX1", "PKX2", "PKX3", "PPX1", "PPX2", "PPX3", "PPX4",
)  # fmt: skip


def tyre_values(machine: Machine) -> dict[str, float]:
    """The parameters of the plant's longitudinal force by their names in tyre property files."""
    return {name: float(getattr(machine.tyre, name.lower())) for name in (*OF_PLANT, *COMBINED)}


def make_rig(
    machine: Machine, seed: int, defects: Defects | None = None, plan: Plan | None = None
) -> tuple[RigLog, RigTruth]:
    """The log of a rig and its truth. defects: all of RIG unless said otherwise."""
    defects, plan = defects or Defects(frozenset(RIG)), plan or Plan()
    random = np.random.default_rng(seed)
    tyre = machine.tyre
    nominal_bar = tyre.nominal_pressure
    nominal = Nominal(load=tyre.nominal_load, pressure=nominal_bar * BAR, radius=tyre.radius)
    scale = SCALE_M * (1.0 + 0.02 * random.standard_normal())
    gain = 1.0 + defects.size("gain", 0.005) * random.standard_normal()
    zero = defects.size("tare", 300.0) * random.standard_normal()
    runs, loads, tares = [], {}, {}
    for kind, piston, inflation, repeat in _programme(plan, nominal_bar):
        name = f"{kind}_pc{piston:g}_pi{inflation:g}_{repeat}"
        load = tyre.nominal_load * (OFFSET + SLOPE * piston)
        tare = zero + defects.size("tare", 100.0) * random.standard_normal()
        speed, wheel = _motion(kind, random)
        force, _ = drum_force(
            wheel_block(machine, inflation),
            1.0,
            np.full(speed.size, load),
            speed,
            wheel,
            1.0 / RATE_HZ / FINER,
        )
        runs.append(replace(
            _measured(kind, speed[::FINER], wheel[::FINER] / scale, gain * force[::FINER] + tare, defects, random),
            name=name, piston_pressure=piston * BAR, inflation=inflation * BAR,
        ))  # fmt: skip
        loads[name], tares[name] = load, tare
    calibration = _calibration(machine, nominal, defects, random)
    truth = RigTruth(
        tyre=tyre_values(machine),
        carcass_stiffness=tyre.longitudinal_stiffness,
        scale=scale,
        gain=gain,
        loads=loads,
        tares=tares,
    )
    return RigLog(
        name="rig",
        nominal=nominal,
        runs=runs,
        calibration=calibration,
        shortest_relaxation=tyre.shortest_relaxation,
    ), truth


def _programme(plan: Plan, nominal_bar: float) -> list[tuple[str, float, float, int]]:
    settings = [(pc, nominal_bar) for pc in plan.piston_bar] + [
        (plan.piston_bar[0], pi) for pi in plan.inflation_bar
    ]
    runs = [
        (kind, pc, pi, k + 1)
        for pc, pi in settings
        for kind in ("drive", "brake")
        for k in range(plan.repeats)
    ]
    runs += [("steps", pc, nominal_bar, 1) for pc in plan.steps_bar]
    return runs + ([("validation", plan.piston_bar[0], nominal_bar, 1)] if plan.validation else [])


def _motion(kind: str, random: np.random.Generator) -> tuple[Array, Array]:
    """Speed of the cylinder and of the wheel's circumference, true (n,), in FINER steps of a sample."""
    rate = RATE_HZ * FINER
    if kind == "drive":
        t = np.arange(0.0, 26.0, 1.0 / rate)
        throttle = np.interp(t, [0.0, 3.0, 13.0, 14.0, 24.0, 26.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
        slip, speed = 2.8 * random.uniform(0.9, 1.05) * throttle**3, np.full(t.size, 1.0 * KMH)
    elif kind == "brake":
        t = np.arange(0.0, 12.0, 1.0 / rate)
        top = random.uniform(5.0, 6.5)  # a foot is not a ramp
        pedal = np.interp(t, [0.0, 2.0, top, top + 0.8, top + 2.5, 12.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
        slip, speed = -random.uniform(0.8, 0.95) * pedal**2.5, np.full(t.size, 5.0 * KMH)
    elif kind == "steps":
        levels = [5, 4, 3, 2, 1, 2, 3, 4, 5]
        t = np.arange(0.0, 6.0 * len(levels), 1.0 / rate)
        at = np.minimum((t / 6.0).astype(int), len(levels) - 1)
        speed = _lagged(np.array(levels, float)[at] * KMH, 0.25, rate)
        slip = _lagged(
            np.array([0.0 if t_ < 2.0 else STEP_SLIPS[5 - levels[i]] for i, t_ in zip(at, t, strict=True)]),
            0.1,
            rate,
        )
    else:
        t = np.arange(0.0, 6.0 * len(VALIDATION_SLIPS), 1.0 / rate)
        at = np.minimum((t / 6.0).astype(int), len(VALIDATION_SLIPS) - 1)
        speed, slip = np.full(t.size, 2.3 * KMH), _lagged(np.array(VALIDATION_SLIPS)[at], 0.2, rate)
    wander = _lagged(random.standard_normal(t.size), 0.5, rate)
    moving = np.minimum(1.0, np.abs(slip) / 0.005)  # an engine that pulls is not perfectly even
    slip = slip * (1.0 + 0.04 * moving * wander / max(float(np.std(wander)), 1e-12))
    drift = _lagged(random.standard_normal(t.size), 2.0, rate)
    speed = speed * (1.0 + 0.003 * drift / max(float(np.std(drift)), 1e-12))
    return speed, speed * (1.0 + slip)


def _lagged(value: Array, time_constant_s: float, rate_hz: float) -> Array:
    a = float(np.exp(-1.0 / (time_constant_s * rate_hz)))
    return np.asarray(lfilter([1.0 - a], [1.0, -a], value, zi=[a * value[0]])[0], float)


def _measured(
    kind: str, speed: Array, shaft: Array, force: Array, defects: Defects, random: np.random.Generator
) -> RigRun:
    """What the DAQ box wrote."""
    n = speed.size
    t = np.arange(n) / RATE_HZ
    noise = defects.size("noise", 1.0)
    ring = ringing(t, 15.0, defects.size("oscillation", 1.0), random)
    speed = speed + noise * 0.002 * random.standard_normal(n)
    shaft = shaft + noise * 0.004 * random.standard_normal(n) + 0.004 * ring
    force = force + noise * 60.0 * random.standard_normal(n) + 150.0 * ring
    share = defects.size("spikes", 4e-4)
    speed, shaft, force = (
        spiked(x, share, size, random) for x, size in ((speed, 1.0), (shaft, 4.0), (force, 2e4))
    )
    gaps = defects.size("dropouts", 3.0)
    speed, shaft, force = (dropped(x, gaps, RATE_HZ, 0.15, random) for x in (speed, shaft, force))
    return RigRun(
        name="",
        kind=kind,
        time=t,
        cylinder_speed=speed,
        force=force,
        shaft_speed=shaft,
        piston_pressure=0.0,
        inflation=0.0,
    )


def _calibration(
    machine: Machine, nominal: Nominal, defects: Defects, random: np.random.Generator
) -> PistonCalibration:
    """Readings of the loaded radius; the stiffness that is believed is not quite that of the tyre."""
    tyre = machine.tyre
    piston = np.arange(5.0)
    share = OFFSET + SLOPE * piston
    q1, q2 = tyre.qfz1, tyre.qfz2
    depth = deflection(share, q1, q2)
    believed = 1.0 + defects.size("calibration", 0.02) * random.standard_normal()
    radius = nominal.radius * (1.0 - depth) + defects.size("calibration", 1e-3) * random.standard_normal(5)
    return PistonCalibration(
        piston_pressure=piston * BAR,
        loaded_radius=radius,
        radius_sd=1e-3,
        q1=q1 * believed,
        q2=q2 * believed,
        stiffness_sd=0.02,
    )
