"""A course on the ground, and a driver model that steers an articulated machine along it by looking ahead.

The driver aims at the point of the centre line that lies LOOK_AHEAD_WHEELBASES in front of the joint, and demands the articulation whose
steady circle leads there (pure pursuit). Torque is proportional to the error of speed; a standing machine accelerates gently.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from plant.plant import Commands, Plant
from plant.sheets.machine import Machine
from plant.truth import Truth
from studies.standards.check import Array

TYRE_WIDTH_PER_RADIUS = 0.528 / 0.743  # of the 20.5R25 [thesis tables 3 and 6]
LOOK_AHEAD_WHEELBASES = 4.0 / 3.0  # with a shorter distance the driver and the lag of the steering oscillate
STEER_GAIN = 6.0  # articulation rate per error [1/s]
SPEED_GAIN = 3.0  # demanded acceleration per error of speed [1/s]
PULL_AWAY = 0.5  # acceleration from standstill [m/s2]
STEP_S = 0.01
STRAIGHT_M = 10.0  # before, between and behind the two lane changes


@dataclass(frozen=True, slots=True)
class Course:
    """Centre line from the joint's start, (n, 2) [m], in equal steps."""

    centre: Array

    @property
    def step(self) -> float:
        """Distance of two neighbouring points [m]."""
        return float(np.hypot(*(self.centre[1] - self.centre[0])))

    def nearest(self, point: Array) -> int:
        """Index of the nearest point of the centre line."""
        return int(np.argmin(((self.centre - point) ** 2).sum(axis=1)))

    def departure(self, point: Array) -> float:
        """Distance of a point from the centre line [m], left positive."""
        # both neighbours are needed for the direction
        i = min(max(self.nearest(point), 1), len(self.centre) - 2)
        along = self.centre[i + 1] - self.centre[i - 1]
        off = point - self.centre[i]
        return float((along[0] * off[1] - along[1] * off[0]) / np.hypot(*along))


def double_lane_change(offset: float, length: float) -> Course:
    """Straight, over by `offset` to the left within `length` [m] on a cosine, straight, back, straight."""
    x = np.arange(0.0, 3 * STRAIGHT_M + 2 * length, 0.1)
    over = np.clip((x - STRAIGHT_M) / length, 0.0, 1.0)
    back = np.clip((x - 2 * STRAIGHT_M - length) / length, 0.0, 1.0)
    # a cosine has no step of its slope at both ends: curvature is what an articulated machine can follow
    y = offset * (np.cos(np.pi * back) - np.cos(np.pi * over)) / 2
    return Course(np.column_stack((x, y)))


def straight(length: float) -> Course:
    """Straight ahead [m]."""
    x = np.arange(0.0, length, 0.1)
    return Course(np.column_stack((x, np.zeros_like(x))))


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive along a course."""

    path: Array  # of the joint (n, 2) [m]
    speed: Array  # (n,) [m/s]
    departure: Array  # of the outermost tyre edge from the centre line, either side (n,) [m]
    load: Array  # normal forces (n, 4) [N]
    finished: bool  # whether the machine reached the end upright


def slow_steering(machine: Machine, share: float) -> Machine:
    """The machine with a share of its articulation rate."""
    return replace(
        machine, steering=replace(machine.steering, rate_limit=share * machine.steering.rate_limit)
    )


def drive(plant: Plant, course: Course, speed: float) -> Drive:
    """The drive of a plant along a course at `speed` [m/s] until its end, or until twice the time that it should take."""
    truth = plant.truth()
    first = truth.speed
    rows: list[tuple[Array, float, float, Array]] = []
    last = len(course.centre) - 1
    limit_s = 2.0 * (last * course.step / speed + speed / PULL_AWAY)
    far = points_ahead(course, plant.machine)
    ended = False
    while truth.time_s < limit_s and abs(truth.roll) < math.pi / 3:
        place = truth.position[:2].copy()
        nearest = course.nearest(place)
        edge = max(abs(course.departure(point)) for point in tyre_edges(plant.machine, truth))
        rows.append((place, truth.speed, edge, truth.normal_force.copy()))
        ended = nearest + far >= last
        if ended:
            break
        # a ramp: full torque at rest would spin the wheels before the course begins
        wanted = min(speed, first + PULL_AWAY * truth.time_s)
        plant.advance(_commands(plant.machine, course, truth, wanted), STEP_S)
        truth = plant.truth()
    path, speeds, edges, loads = (np.array(column) for column in zip(*rows, strict=True))
    return Drive(path, speeds, edges, loads, ended)


def points_ahead(course: Course, machine: Machine) -> int:
    """How many points of the centre line the driver looks ahead."""
    wheelbase = machine.geometry.front_axle_x - machine.geometry.rear_axle_x
    return round(LOOK_AHEAD_WHEELBASES * wheelbase / course.step)


def _commands(machine: Machine, course: Course, truth: Truth, speed: float) -> Commands:
    """The driver's demands at one instant."""
    place = truth.position[:2]
    aim = course.centre[min(course.nearest(place) + points_ahead(course, machine), len(course.centre) - 1)]
    ahead, behind = machine.geometry.front_axle_x, -machine.geometry.rear_axle_x
    delta = truth.articulation_angle
    # the joint travels between the directions of both frames, by their lengths
    travel = truth.yaw + math.atan2(behind * math.sin(delta), ahead + behind * math.cos(delta))
    off = aim - place
    bearing = math.remainder(math.atan2(off[1], off[0]) - travel, math.tau)
    # circle through the joint along its direction of travel and through the aim (pure pursuit)
    curvature = 2.0 * math.sin(bearing) / math.hypot(*off)
    limit = machine.steering.limit
    # a machine with halves of equal length on a circle of this curvature is articulated by 2 atan(curvature L / 2)
    wanted = min(max(2.0 * math.atan(curvature * (ahead + behind) / 2.0), -limit), limit)
    torque = machine.mass * SPEED_GAIN * (speed - truth.speed) * machine.tyre.radius / 4.0
    return Commands(wheel_torque=(torque,) * 4, articulation_rate=STEER_GAIN * (wanted - delta))


def tyre_edges(machine: Machine, truth: Truth) -> Array:
    """Outer edges of the four tyres on the ground, (4, 2) [m]; the small lean is left out."""
    g = machine.geometry
    half = g.track / 2.0 + half_tyre_width(machine)
    sides = np.array(((1.0,), (-1.0,))) * half
    points = []
    for angle, x in (
        (truth.yaw + truth.articulation_angle, g.front_axle_x),
        (truth.yaw, g.rear_axle_x),
    ):
        forward = np.array((math.cos(angle), math.sin(angle)))
        left = np.array((-forward[1], forward[0]))
        points.append(truth.position[:2] + x * forward + sides * left)
    return np.concatenate(points)


def half_tyre_width(machine: Machine) -> float:
    """Half the width of a tyre [m], in the proportion of the 20.5R25."""
    return TYRE_WIDTH_PER_RADIUS * machine.tyre.radius / 2.0
