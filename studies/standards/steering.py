"""Steering: a course as in ISO 5010 with primary and secondary steering, time from lock to lock, turning circle."""

import math

import numpy as np

from plant.plant import Commands, Plant
from plant.sheets.machine import Machine
from studies.standards.check import Bound, Candidate, Chart, Check, Clause, Findings, Line, Standard
from studies.standards.course import (
    LOOK_AHEAD_WHEELBASES,
    STEP_S,
    Course,
    Drive,
    double_lane_change,
    drive,
    half_tyre_width,
    slow_steering,
)

KMH = 1.0 / 3.6
TEST_KMH, SECONDARY_KMH, TOLERANCE_KMH = 16.0, 8.0, 2.0
CORRIDOR_PER_WIDTH = 1.25  # corridor over the machine's width across its tyres
CHANGE_M = 15.0  # length of one lane change
SECONDARY_SHARE = 0.5  # share of the articulation rate that remains with the engine stopped (assumed)
CREEP_KMH = 3.0  # for the turning circle: side slip angles are then negligible
SETTLED_S = 3.0  # until the turn is steady

COURSE = Clause(
    source="ISO 5010",
    detail="2019 edition, clauses 5 and 8: shape of the course, corridor and speeds",
    verified=False,
)


def width_across_tyres(machine: Machine) -> float:
    """Width of the machine across its tyres [m]."""
    return machine.geometry.track + 2.0 * half_tyre_width(machine)


def perform(candidate: Candidate) -> Findings:
    """The course empty and loaded with primary steering, empty with secondary steering; then the values for information."""
    machine = candidate.machine
    width = width_across_tyres(machine)
    course = double_lane_change(CORRIDOR_PER_WIDTH * width, CHANGE_M)
    slow = slow_steering(machine, SECONDARY_SHARE)
    rated = candidate.rated_payload
    drives = {
        "primary, empty": _drive(machine, 0.0, course, TEST_KMH),
        f"primary, {rated:.0f} kg": _drive(machine, rated, course, TEST_KMH),
        "secondary, empty": _drive(slow, 0.0, course, SECONDARY_KMH),
    }
    checks: list[Check] = []
    for name, done in drives.items():
        kmh = SECONDARY_KMH if name.startswith("secondary") else TEST_KMH
        checks += course_checks(name, done, kmh, CORRIDOR_PER_WIDTH * width / 2.0)
    checks += [
        Check(what="lock to lock at standstill", unit="s", measured=lock_to_lock(machine)),
        Check(
            what="turning circle, outer tyre's centre, full lock",
            unit="m",
            measured=2.0 * turning_radius(machine),
        ),
    ]
    return Findings(checks=tuple(checks), charts=(_map(course, drives, width),))


def _drive(machine: Machine, payload: float, course: Course, kmh: float) -> Drive:
    plant = Plant(machine, payload_mass=payload, speed=kmh * KMH)
    return drive(plant, course, kmh * KMH)


def course_checks(name: str, done: Drive, kmh: float, half_corridor: float) -> list[Check]:
    """Checks of corridor and speed; without a measured value if the drive did not reach the end."""
    # a drive that ended early has kept the corridor only so far
    off = float(done.departure.max()) if done.finished else math.nan
    error = float(np.abs(done.speed - kmh * KMH).max()) / KMH if done.finished else math.nan
    return [
        Check(
            what=f"outermost tyre edge from the centre line, {name}, {kmh:.0f} km/h",
            unit="m",
            measured=off,
            bound=Bound("at most", half_corridor, COURSE),
        ),
        Check(
            what=f"speed off {kmh:.0f} km/h, {name}",
            unit="km/h",
            measured=error,
            bound=Bound("at most", TOLERANCE_KMH, COURSE),
        ),
    ]


def lock_to_lock(machine: Machine) -> float:
    """Time [s] from the right end of the articulation to 99 % of the left one, wheels free, engine running."""
    limit = machine.steering.limit
    plant = Plant(machine, articulation_angle=-limit)
    commands = Commands(articulation_rate=machine.steering.rate_limit)
    # five times what the steering needs at its full rate; a blocked one must not run for ever
    longest = 10.0 * limit / machine.steering.rate_limit
    while plant.truth().articulation_angle < 0.99 * limit:
        if plant.time_s > longest:
            return math.nan
        plant.advance(commands, STEP_S)
    return plant.time_s


def turning_radius(machine: Machine) -> float:
    """Radius of the outermost tyre's centre at creep and full lock [m], from speed over yaw rate.

    Both axles point at the centre of the turn, so the distances of their middles follow from that of the joint by Pythagoras.
    """
    ahead, behind = machine.geometry.front_axle_x, machine.geometry.rear_axle_x
    speed = CREEP_KMH * KMH
    plant = Plant(machine, speed=speed, articulation_angle=machine.steering.limit)
    plant.advance(Commands(), SETTLED_S)
    truth = plant.truth()
    # the rear axle's middle moves along its frame, so its radius is speed over yaw rate
    rear = truth.speed / truth.angular_velocity[2]
    front = math.sqrt(rear**2 + behind**2 - ahead**2)
    return max(front, rear) + machine.geometry.track / 2.0


def _map(course: Course, drives: dict[str, Drive], width: float) -> Chart:
    half = CORRIDOR_PER_WIDTH * width / 2.0
    along = np.gradient(course.centre, axis=0)
    left = np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None]
    edges = [course.centre + side * half * left for side in (1.0, -1.0)]
    lines = [
        Line(name, edge[:, 0], edge[:, 1], dashed=True)
        for name, edge in zip(("corridor", ""), edges, strict=True)
    ]
    lines += [Line(name, done.path[:, 0], done.path[:, 1]) for name, done in drives.items()]
    return Chart(title="Path of the articulation joint", x="x [m]", y="y [m]", lines=tuple(lines), equal=True)


STANDARD = Standard(
    name="steering",
    title="ISO 5010: steering",
    method=(
        f"A driver who looks {LOOK_AHEAD_WHEELBASES:.1f} wheelbases ahead steers the machine through two lane changes of one corridor's width within 15 m, at 16 km/h with "
        "primary and at 8 km/h with secondary steering (half the articulation rate, assumed). The corridor is 1.25 times the width across the "
        "tyres; tyres' outer edges have to stay in it. Lock to lock and turning circle only inform."
    ),
    perform=perform,
)
