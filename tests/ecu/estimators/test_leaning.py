"""Wheel loads on a tilted frame: against a rotation written out, and against the plant's own tyre forces."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ecu.estimators.joint import joint_at
from ecu.estimators.loads.leaning import leaning
from ecu.estimators.quantities import NormalForces
from ecu.estimators.tyres.contact import Tilt
from plant.unit.scenario import Start
from plant.unit.script import Script
from studies.thesis.drive import drive_case, driven, estimated, line
from studies.thesis.split import SHEET, parameters_of

G = parameters_of(SHEET).geometry
LOADS = NormalForces(21e3, 39e3, 0.0, 30e3, 33e3)


@pytest.mark.parametrize("angle", [-0.6, 0.0, 0.3])
@pytest.mark.parametrize(("roll", "pitch"), [(0.01, 0.0), (0.0, -0.01), (0.008, 0.012)])
def test_parts_and_moments_are_those_of_a_load_turned_into_the_frame(angle, roll, pitch):
    upright = Rotation.from_rotvec([roll, pitch, 0.0]).inv().apply([0.0, 0.0, 1.0])
    c, s, half = math.cos(angle), math.sin(angle), G.front_track / 2.0
    places = [
        (G.front_length * c - half * s, G.front_length * s + half * c, 0.0),
        (G.front_length * c + half * s, G.front_length * s - half * c, 0.0),
        (-G.rear_length, G.rear_track / 2.0, 0.0),
        (-G.rear_length, -G.rear_track / 2.0, 0.0),
    ]
    loads = (LOADS.front_left, LOADS.front_right, LOADS.rear_left, LOADS.rear_right)
    forces = [load * upright for load in loads]
    turning = [float(np.cross(place, force)[2]) for place, force in zip(places, forces, strict=True)]
    found = leaning(LOADS, Tilt(roll, pitch), joint_at(angle), G)
    near = {"rel": 1e-3, "abs": 2.0}  # angles of a hundredth: the law is linear in them
    assert found.along == pytest.approx(sum(f[0] for f in forces), **near)
    assert found.across == pytest.approx(sum(f[1] for f in forces), **near)
    assert found.rear == pytest.approx(forces[2][1] + forces[3][1], **near)
    assert found.front_moment == pytest.approx(turning[0] + turning[1], **near)
    assert found.rear_moment == pytest.approx(turning[2] + turning[3], **near)


@pytest.fixture(scope="module", params=[0.0, 3204.0])
def turn(request):
    """A turn to the right with and without a load: truth and estimates once it is steady."""
    script = Script(speed=line((0.0, 2.5)), articulation_angle=line((1.0, 0.0), (3.0, -math.radians(25.0))))
    truth = driven(drive_case(15.0, start=Start(speed=2.5), payload=request.param, script=script), SHEET)
    late = truth["time_s"] > 8.0
    estimates = estimated(truth, SHEET, "corrected")
    return {k: v[late] for k, v in truth.items()}, {k: v[late] for k, v in estimates.items()}


@pytest.mark.parametrize(("first", "second"), [(1, 2), (3, 4)])
def test_an_axles_lateral_force_in_a_turn_is_the_plants(turn, first, second):
    """Within 150 N; with loads square to the frame it is 330 to 640 N off."""
    truth, estimates = turn
    found = estimates[f"lateral_{first}"] + estimates[f"lateral_{second}"]
    true = truth["lateral_force"][:, first - 1] + truth["lateral_force"][:, second - 1]
    assert np.mean(found - true) == pytest.approx(0.0, abs=150.0)


def test_rear_wheels_share_their_load_as_the_plants_do(turn):
    """The rear axle stays with the road while the frame rolls above it; if it rolled along they would be 200 N off."""
    truth, estimates = turn
    found = estimates["normal_4"] - estimates["normal_3"]
    true = truth["normal_force"][:, 3] - truth["normal_force"][:, 2]
    assert np.mean(found - true) == pytest.approx(0.0, abs=160.0)


def test_held_wheels_of_a_standing_machine_push_nothing():
    """A machine with a load is pitched by its tyres; its brakes have nothing to bear on level ground."""
    truth = driven(drive_case(4.0, start=Start(), payload=3204.0, script=Script()), SHEET)
    estimates = estimated(truth, SHEET, "corrected")
    late = truth["time_s"] > 2.0
    for n in range(1, 5):
        assert np.abs(estimates[f"longitudinal_{n}"][late]).max() < 20.0
