"""Raw recordings of a field test, made from the plant's tyre with the events and the defects of the thesis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from identify.field.log import FieldLog, Somat, Vicon
from identify.make.defects import FIELD, Defects, dropped, ringing, spiked
from identify.make.drum import at_slip_angle, drum_force, wheel_block
from identify.make.rig import tyre_values
from identify.tyre.parameters import Nominal
from identify.tyre.patch import deflection
from plant.sheets.machine import Machine

Array = NDArray[np.float64]

VICON_HZ, SOMAT_HZ, TRUTH_HZ = 200.0, 500.0, 1000.0
EVENT_S, OUTSIDE_S, STANDING_S = 8.0, 5.0, 4.0
SLIPS = (0.008, -0.008, 0.015, -0.015, 0.03, -0.03, 0.05, -0.06, 0.1, -0.12, 0.25, 0.6, -0.4, 1.2)
ANGLE_SLIPS = (0.02, 0.1, -0.15, 0.4)
"""Of the events at a slip angle; each at half and at the whole angle, to both sides."""
ANGLE_SHARES = (0.5, -0.5, 1.0, -1.0)
LOADS = (27e3, 34e3, 44e3)  # on the road, of the events in turn
HEIGHT_TILT = (0.002, -0.003)  # slopes of the ground along x and y


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldTruth:
    """What a field log hides."""

    tyre: dict[str, float]
    offset: float  # Vicon's time of the transducer's zero [s], positions' delay included
    drift: float  # relative: how much slower the transducer's clock is
    lost_event: int  # number of the event that is not synchronised, -1 if none
    gain: float
    tare: float  # [N]
    slips: tuple[float, ...]
    heading: float  # of the markers beside the wheel's plane [rad]


def make_field(
    machine: Machine, seed: int, defects: Defects | None = None, slip_angle: float = 0.0
) -> tuple[FieldLog, FieldTruth]:
    """The log of a field test and its truth. defects: all of FIELD unless said otherwise.

    slip_angle [rad]: 16 further events with the wheel turned against its path by up to this angle.
    """
    defects = defects or Defects(frozenset(FIELD))
    random = np.random.default_rng([seed, 3])
    nominal = Nominal(
        load=machine.tyre.nominal_load,
        pressure=machine.tyre.nominal_pressure * 1e5,
        radius=machine.tyre.radius,
    )
    order = random.permutation(len(SLIPS))
    passages = [(SLIPS[i], 0.0) for i in order]
    turned_events = [(slip, share * slip_angle) for share in ANGLE_SHARES for slip in ANGLE_SLIPS]
    if slip_angle > 0.0:
        passages += [turned_events[i] for i in random.permutation(len(turned_events))]
    slips = tuple(slip for slip, _ in passages)
    t = np.arange(0.0, STANDING_S + len(slips) * (EVENT_S + OUTSIDE_S) + 2.0, 1.0 / TRUTH_HZ)
    inside, path_speed, kappa, load, angle = _drive(t, passages, random)
    speed = path_speed * np.cos(angle)
    w = wheel_block(machine, machine.tyre.nominal_pressure)
    share = load / nominal.load
    depth = deflection(share, machine.tyre.qfz1, machine.tyre.qfz2)
    loaded = nominal.radius * (1.0 - depth)
    rolling = 3.0 * loaded / (1.0 + 2.0 * loaded / nominal.radius)
    force, transient = drum_force(w, 1.0, load, speed, speed * (1.0 + kappa), 1.0 / TRUTH_HZ)
    side_force = np.zeros(t.size)
    if slip_angle > 0.0:
        # the angle is held throughout an event, so that its own transient is over
        force, side_force = at_slip_angle(w, 1.0, load, transient, np.tan(angle))
    turned = np.cumsum(speed * (1.0 + kappa) / rolling) / TRUTH_HZ
    yaw = 0.3 + 0.05 * np.sin(0.11 * t)
    x, y = np.cumsum(path_speed * np.cos(yaw)) / TRUTH_HZ, np.cumsum(path_speed * np.sin(yaw)) / TRUTH_HZ
    start = np.concatenate(([0], np.flatnonzero(np.diff(inside.astype(int)) == 1) + 1))
    for at in start:  # every event enters at the same place
        x[at:] -= x[at]
        y[at:] -= y[at] - 1.0
    ground = HEIGHT_TILT[0] * x + HEIGHT_TILT[1] * y
    zero = STANDING_S - random.uniform(3.0, 3.6)
    drift = defects.size("drift", 40e-6) * random.uniform(0.5, 1.5) * random.choice([-1.0, 1.0])
    delay = defects.size("delay", random.uniform(0.01, 0.04))
    lost = int(random.integers(len(slips))) if "lost_event" in defects else -1
    gain = 1.0 + defects.size("gain", 0.005) * random.standard_normal()
    tare = defects.size("tare", 250.0) * random.standard_normal()
    high = defects.size("radius", 0.003) * random.standard_normal()  # markers are not exactly on the axle
    # a generator of its own: a recording without this defect has the same other errors
    heading = defects.size("heading", 0.004) * random.spawn(1)[0].standard_normal()
    truth = (t, x, y, loaded + ground + high, turned, yaw + angle + heading, inside)
    somat = _somat(
        t, turned, (force, side_force, load), start, zero, drift, lost, gain, tare, defects, random
    )
    log = FieldLog(
        name="field",
        nominal=nominal,
        vicon=_vicon(truth, zero, delay, defects, random),
        somat=somat,
        ground=_ground(random),
        standing_s=1.4,
    )
    return log, FieldTruth(
        tyre=tyre_values(machine),
        offset=zero + delay,
        drift=drift,
        lost_event=lost,
        gain=gain,
        tare=tare,
        slips=slips,
        heading=heading,
    )


def _drive(
    t: Array, passages: Sequence[tuple[float, float]], random: np.random.Generator
) -> tuple[NDArray[np.bool_], Array, Array, Array, Array]:
    """Inside the scope or not, speed on the path, slip, load and slip angle [rad] over true time (n,). passages: slip and slip angle of each."""
    inside, speed, kappa, load, angle = (
        np.zeros(t.size, bool),
        np.zeros(t.size),
        np.zeros(t.size),
        np.full(t.size, LOADS[0]),
        np.zeros(t.size),
    )
    for i, (slip, turn) in enumerate(passages):
        start = STANDING_S + i * (EVENT_S + OUTSIDE_S)
        s = t - start
        part = (s >= 0.0) & (s < EVENT_S)
        near = (s >= -1.5) & (s < EVENT_S + 1.5)
        inside |= part
        fast = random.uniform(1.8, 2.6)
        pull = 0.15 * np.sign(slip)
        speed[near] = np.maximum(
            fast
            * np.clip((s[near] + 1.5) / 1.4, 0.0, 1.0)
            * np.clip((EVENT_S + 1.5 - s[near]) / 1.4, 0.0, 1.0)
            + pull * np.clip(s[near] - 2.0, 0.0, 4.0),
            0.0,
        )
        kappa[near] = (
            slip * np.clip((s[near] - 2.0) / 0.6, 0.0, 1.0) * np.clip((6.6 - s[near]) / 0.6, 0.0, 1.0)
        )
        held = LOADS[i % len(LOADS)] * (1.0 + 0.01 * np.sin(2.0 * np.pi * 1.3 * t))
        angle = np.where((s >= -2.0) & (s < EVENT_S + 2.0), turn, angle)
        load = np.where((s >= -1.5) & (s < EVENT_S + 1.5), held, load)
    return (
        inside,
        gaussian_filter1d(speed, 60.0),
        gaussian_filter1d(kappa, 30.0),
        gaussian_filter1d(load, 200.0),
        gaussian_filter1d(angle, 60.0),
    )


def _vicon(
    truth: tuple[Array, Array, Array, Array, Array, Array, NDArray[np.bool_]],
    zero: float,
    delay: float,
    defects: Defects,
    random: np.random.Generator,
) -> Vicon:
    t, x, y, z, turned, yaw, inside = truth
    stamps = np.arange(0.0, t[-1] - 0.1, 1.0 / VICON_HZ)
    if "uneven" in defects:
        stamps = np.sort(stamps + random.uniform(-1.5e-3, 1.5e-3, stamps.size))
        stamps = stamps[random.random(stamps.size) > 0.03]
    noise = defects.size("noise", 1.0)
    seen = np.interp(stamps - delay, t, inside.astype(float)) > 0.5
    values = [np.interp(stamps - delay, t, v) for v in (x, y, z, turned, yaw)]
    for i, size in enumerate((5e-4, 5e-4, 5e-4, 1.5e-3, 1.5e-3)):
        values[i] = values[i] + noise * size * random.standard_normal(stamps.size)
        values[i] = dropped(values[i], defects.size("dropouts", 2.0), VICON_HZ, 0.3, random)
        values[i] = spiked(values[i], defects.size("spikes", 3e-4), 0.3, random)
    values[3] = np.angle(np.exp(1j * values[3])) if "wrap" in defects else values[3]
    values = [np.where(seen, v, 0.0) for v in values]
    pulse = np.where((stamps >= zero) & (((stamps - zero) % 1.0) < 0.5) & (stamps < zero + 10.0), 5.0, 0.0)
    pulse = np.zeros(stamps.size) if "no_pulse" in defects else pulse
    if "duplicates" in defects:
        again = np.sort(
            np.concatenate([np.arange(stamps.size), np.flatnonzero(random.random(stamps.size) < 0.02)])
        )
        stamps, pulse, values = stamps[again], pulse[again], [v[again] for v in values]
    return Vicon(
        time=stamps, x=values[0], y=values[1], z=values[2], pitch=values[3], yaw=values[4], sync=pulse
    )


def _somat(
    t: Array,
    turned: Array,
    forces: tuple[Array, Array, Array],
    starts: Array,
    zero: float,
    drift: float,
    lost: int,
    gain: float,
    tare: float,
    defects: Defects,
    random: np.random.Generator,
) -> Somat:
    force, across, load = forces
    clock = np.arange(0.0, (t[-1] - zero) * (1.0 - 1e-3) - 0.1, 1.0 / SOMAT_HZ)
    true = zero + clock * (1.0 + drift)
    if lost >= 0:  # the logger was restarted between two events: one of them is shifted
        begin = STANDING_S + lost * (EVENT_S + OUTSIDE_S) - 0.5 * OUTSIDE_S
        true = np.where((true > begin) & (true < begin + EVENT_S + OUTSIDE_S), true + 0.7, true)
    angle = np.interp(true, t, turned)
    angle = np.round(angle * 2048.0 / (2.0 * np.pi)) * 2.0 * np.pi / 2048.0
    if "wrap" in defects:
        angle = np.angle(np.exp(1j * angle))
    ring = ringing(clock, 15.0, defects.size("oscillation", 1.0), random)
    noise = defects.size("noise", 1.0)
    fx = (
        gain * np.interp(true, t, force)
        + tare
        + 300.0 * ring
        + noise * 150.0 * random.standard_normal(clock.size)
    )
    fz = (
        gain * np.interp(true, t, load)
        - 4190.0
        + 300.0 * ring
        + noise * 150.0 * random.standard_normal(clock.size)
    )
    fx, fz = (spiked(v, defects.size("spikes", 3e-4), 2e4, random) for v in (fx, fz))
    fy = gain * np.interp(true, t, across) + noise * 150.0 * random.standard_normal(clock.size)
    return Somat(time=clock, angle=angle, fx=fx, fy=fy, fz=fz)


def _ground(random: np.random.Generator) -> Array:
    x, y = (v.ravel() for v in np.meshgrid(np.arange(-1.0, 24.0, 1.0), np.arange(-4.0, 14.0, 1.0)))
    return np.stack(
        [x, y, HEIGHT_TILT[0] * x + HEIGHT_TILT[1] * y + 5e-4 * random.standard_normal(x.size)], axis=1
    )
