"""Stopping distances after ISO 3450 and 30 CFR 57.14101."""

import math
from dataclasses import dataclass

import numpy as np

from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.unit.actuators import Four, abilities_of, four
from studies.standards.check import Array, Bound, Candidate, Chart, Check, Clause, Findings, Line, Standard

KMH = 1.0 / 3.6
ISO_KMH = (28.0, 35.0)  # top speed of the L60 [thesis table 2] and 80 % of it
MINE_KMH = 32.18688  # 20 miles per hour, the last column of the table
ROAD = 0.75  # dry asphalt
EVERY_S = 0.01  # between samples
LONGEST_S = 20.0  # after which the machine is taken not to stop
STANDING = 0.02  # speed below which it stands [m/s]
FAILED_CIRCUITS = {"rear brakes failed": (1.0, 1.0, 0.0, 0.0), "front brakes failed": (0.0, 0.0, 1.0, 1.0)}

ISO = Clause(source="ISO 3450", detail="2011 edition, table 3, loaders up to 32 t", verified=False)
MINES = Clause(source="30 CFR 57.14101", detail="table M-1, up to 36 000 lb", verified=True)
FOOT = 0.3048
MINES_DECELERATION = 9.66 * FOOT  # [m/s2]
MINES_DELAY_S = 0.5 + 1.0  # of the brake system and of the operator
MINES_MASS_KG = 36_000 * 0.45359237


def iso_service(speed_kmh: float) -> float:
    """Longest stopping distance of the service brakes [m], loaders up to 32 t."""
    return speed_kmh**2 / 150.0 + 0.2 * (speed_kmh + 5.0)


def iso_secondary(speed_kmh: float) -> float:
    """The same after the failure of one circuit."""
    return speed_kmh**2 / 75.0 + 0.4 * (speed_kmh + 5.0)


def mine_service(speed: float) -> float:
    """Longest stopping distance [m] from `speed` [m/s], without the operator's reaction time: the simulation brakes at once."""
    # the table counts one second of reaction, which the simulated driver does not need
    return speed * (MINES_DELAY_S - 1.0) + speed**2 / (2.0 * MINES_DECELERATION)


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop."""

    time_s: Array  # since the brake was applied
    speed: Array  # [m/s]
    travelled: Array  # since then [m]
    distance_m: float  # stopping distance; NaN if the machine did not stop


def stop(
    candidate: Candidate,
    speed: float,
    payload: float,
    working: tuple[float, float, float, float] = (1.0,) * 4,
    friction: float = ROAD,
) -> Stop:
    """Full braking from `speed` [m/s] on level ground, wheels free of drive torque; working: share of each brake."""
    plant = Plant(candidate.machine, Surface(friction=friction), payload_mass=payload, speed=speed)
    brakes = full_brakes(candidate)
    torque = four(share * brake for share, brake in zip(working, brakes, strict=True))
    commands = Commands(brake_torque=torque)
    start = plant.truth().position
    times, speeds, ways = [0.0], [speed], [0.0]
    # a threshold above zero: the machine rocks on its tyres after the stop
    while speeds[-1] > STANDING and times[-1] < LONGEST_S:
        plant.advance(commands, EVERY_S)
        truth = plant.truth()
        times.append(truth.time_s)
        speeds.append(truth.speed)
        ways.append(float(np.hypot(*(truth.position - start)[:2])))
    stood = speeds[-1] <= STANDING
    return Stop(np.array(times), np.array(speeds), np.array(ways), ways[-1] if stood else math.nan)


def full_brakes(candidate: Candidate) -> Four:
    """Torque of full service braking at each wheel [N m]."""
    return abilities_of(candidate.machine, candidate.equipment.actuators).brake_torque


def perform(candidate: Candidate) -> Findings:
    """Service and secondary braking, empty and with the rated payload."""
    checks, lines = [], []
    for load, payload in (("empty", 0.0), (f"{candidate.rated_payload:.0f} kg", candidate.rated_payload)):
        for kmh in ISO_KMH:
            done = stop(candidate, kmh * KMH, payload)
            checks.append(check_of(f"service brakes, {load}, {kmh:.0f} km/h", done, iso_service(kmh), ISO))
            lines.append(Line(f"{load}, {kmh:.0f} km/h", done.travelled, done.speed / KMH))
        done = stop(candidate, MINE_KMH * KMH, payload)
        # the table gives heavier machines other distances
        if candidate.machine.mass + payload <= MINES_MASS_KG:
            limit = mine_service(MINE_KMH * KMH)
            checks.append(check_of(f"service brakes, {load}, {MINE_KMH:.1f} km/h", done, limit, MINES))
        for failure, working in FAILED_CIRCUITS.items():
            for kmh in ISO_KMH:
                done = stop(candidate, kmh * KMH, payload, working)
                what = f"{failure}, {load}, {kmh:.0f} km/h"
                checks.append(check_of(what, done, iso_secondary(kmh), ISO))
    speeds = np.linspace(0.0, ISO_KMH[-1], 50)
    lines.append(Line("permitted, service", iso_service(speeds), speeds, dashed=True))  # type: ignore[arg-type]
    chart = Chart(title="Service brakes", x="distance [m]", y="speed [km/h]", lines=tuple(lines))
    return Findings(checks=tuple(checks), charts=(chart,))


def check_of(what: str, done: Stop, limit: float, clause: Clause) -> Check:
    return Check(
        what=what,
        unit="m",
        measured=done.distance_m,
        bound=Bound("at most", limit, clause),
    )


STANDARD = Standard(
    name="stopping",
    title="ISO 3450 and 30 CFR 57.14101: stopping distance",
    method=(
        "On level dry asphalt (sliding friction 0.75) the machine rolls without drive torque and the brake is put on in full at once; the "
        "distance counts from that moment until it stands. Service brakes with all wheels, secondary braking with one circuit failed."
    ),
    perform=perform,
)
