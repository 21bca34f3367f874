"""The printed estimators as a model: without corrections they are the ECU's printed forms, with the right ones Newton's."""

import dataclasses
import math

import numpy as np
import pytest

from discrepancy.models import printed
from discrepancy.models.printed_forms import COLUMNS, Corrections, Moment, estimate
from discrepancy.signals.recording import Recording, signal
from ecu.calibration import load_calibration
from ecu.estimators.loads import normal_force
from ecu.estimators.loads.cog import front_unit, machine_centre, with_axle
from ecu.estimators.printed.centre import front_unit_printed
from ecu.estimators.printed.motion import printed_acceleration
from ecu.estimators.printed.normal_force import printed_arms, printed_normal_forces
from ecu.estimators.printed.turning import yaw_moment_printed
from ecu.estimators.quantities import WheelForces
from ecu.estimators.stability.turning import joint_torque, yaw_moment

P = load_calibration("l60").parameters
G = P.geometry
LOAD = 800.0
GRAVITY = 9.81
FORCES = WheelForces(5e3, 4e3, 2e3, 3e3, -3e3, -2e3, 2.5e3, 4e3)
MOMENTS = [
    Moment(0.35, 0.03, -0.05, -0.6, 0.8, 0.1, 0.2, 0.3, -0.1, 2.0, 0.7),
    Moment(-0.5, -0.02, 0.04, 0.2, 0.3, -0.3, -0.4, 0.1, 0.2, 3.0, -1.5),
    Moment(0.0, 0.0, 0.0, -0.6, 0.8, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
]
LEVEL = [m._replace(roll=0.0, pitch=0.0) for m in MOMENTS]


def estimated(moment, **corrections):
    rows = np.array([[*moment, *FORCES]])
    assert rows.shape == (1, COLUMNS)
    normal, side, torque = np.empty((1, 4)), np.empty(1), np.empty(1)
    estimate(rows, Corrections(**corrections), LOAD, P, normal, side, torque)
    return normal[0], float(side[0]), float(torque[0])


def centre_of(moment):
    front = front_unit_printed(moment.lift_arm, LOAD, P.front, P.arm, P.bucket)
    return front, machine_centre(moment.articulation, front, P.rear)


@pytest.mark.parametrize("moment", MOMENTS)
def test_without_corrections_the_loads_are_those_of_the_printed_solution(moment):
    """The ECU has (88)-(92) as solved; here the balances are solved anew."""
    _, centre = centre_of(moment)
    d = moment.articulation
    ax, ay_right = printed_acceleration(moment.acceleration, -d)
    n = printed_normal_forces(
        centre.mass, centre.z, printed_arms(centre, d, G), ax, ay_right, -moment.pitch, -moment.roll, GRAVITY,
        P.axle.mass, P.axle.height, G.rear_track / 2.0, G.pivot_height,
    )  # fmt: skip
    assert estimated(moment)[0] == pytest.approx((n.front_left, n.front_right, n.rear_left, n.rear_right))


@pytest.mark.parametrize("moment", LEVEL)
def test_with_all_that_is_missing_they_are_the_closed_form_of_the_rigid_machine(moment):
    """The barycentric form of the corrected estimators, for the acceleration of the centre of gravity."""
    _, centre = centre_of(moment)
    d, share = moment.articulation, normal_force.lateral_share(centre.x, moment.articulation, G)
    fx, across = printed_acceleration(moment.acceleration, d)
    fy = across + moment.speed * moment.yaw_rate
    n = normal_force.rigid_normal_forces(centre, d, fx, fy, GRAVITY, P.axle.mass, P.axle.height, share, G)
    found = estimated(moment, pivot_arm=1.0, trunnion=1.0, centripetal=1.0, lateral_share=share - 0.5)[0]
    assert found == pytest.approx((n.front_left, n.front_right, n.rear_left, n.rear_right))


@pytest.mark.parametrize("moment", MOMENTS)
def test_turning_torque_from_the_print_to_the_torque_at_the_joint(moment):
    printed_front, _ = centre_of(moment)
    whole = front_unit(moment.lift_arm, moment.bucket, LOAD, P.front, P.arm, P.bucket)
    front = whole._replace(
        x=printed_front.x, z=printed_front.z
    )  # inertias are not the print's to get wrong: it has none
    rear = with_axle(P.rear, P.axle, G)
    together = machine_centre(moment.articulation, front, rear)
    d, t = moment.articulation, P.wheel.pneumatic_trail
    assert estimated(moment)[2] == pytest.approx(yaw_moment_printed(FORCES, together.x, together.y, d, G))
    assert estimated(moment, rotation=1.0)[2] == pytest.approx(
        yaw_moment(FORCES, together.x, together.y, d, G)
    )
    at_joint = estimated(moment, rotation=1.0, about_joint=1.0)[2]
    assert at_joint == pytest.approx(yaw_moment(FORCES, 0.0, 0.0, d, G))
    bent = joint_torque(
        FORCES, -t * (FORCES.y1 + FORCES.y2), -t * (FORCES.y3 + FORCES.y4), d, moment.yaw_rate, moment.articulation_rate,
        moment.articulation_acceleration, front, rear, G,
    ).torque  # fmt: skip
    assert estimated(moment, rotation=1.0, between_halves=1.0)[2] == pytest.approx(bent)


@pytest.mark.parametrize("moment", LEVEL)
def test_with_the_arm_turned_about_its_pivot_the_centre_is_the_true_one(moment):
    """E-11, E-12 mended: loads of the machine at rest are those of the corrected centre of gravity."""
    still = moment._replace(
        articulation_rate=0.0, yaw_rate=0.0, yaw_acceleration=0.0, speed=0.0, acceleration=0.0
    )
    front = front_unit(still.lift_arm, still.bucket, LOAD, P.front, P.arm, P.bucket)
    centre = machine_centre(still.articulation, front, P.rear)
    n = normal_force.rigid_normal_forces(
        centre, still.articulation, 0.0, 0.0, GRAVITY, P.axle.mass, P.axle.height, 0.5, G
    )
    found = estimated(still, pivot_arm=1.0, arm_rotation=1.0)[0]
    assert found == pytest.approx((n.front_left, n.front_right, n.rear_left, n.rear_right))


def test_the_lateral_reading_of_the_print_is_gravity_and_the_speeds_derivative_alone():
    m = MOMENTS[0]
    expected = m.acceleration * math.sin(m.articulation / 2) + GRAVITY * math.sin(m.roll)
    assert estimated(m)[1] == pytest.approx(expected)
    assert estimated(m, centripetal=1.0)[1] == pytest.approx(expected + m.speed * m.yaw_rate)


def test_the_tare_of_a_hub_is_its_wheels_weight():
    bare, weighed = estimated(MOMENTS[2])[0], estimated(MOMENTS[2], hub_tare=1.0)[0]
    assert bare - weighed == pytest.approx([426.0 * GRAVITY] * 4)


def test_every_correction_is_an_effect_that_changes_an_output():
    parameters = {p.name for effect in printed.LIBRARY for p in effect.parameters}
    assert set(Corrections._fields) <= parameters
    moment = MOMENTS[0]
    before = np.hstack(estimated(moment))
    for effect in printed.LIBRARY:
        for p in effect.parameters:
            if p.name in Corrections._fields:
                after = np.hstack(estimated(moment, **{p.name: p.typical}))
                assert np.abs(after - before).max() > 1.0, p.name
                assert p.value == 0.0


def test_every_confusable_is_in_the_library():
    names = {effect.name for effect in printed.LIBRARY}
    physics = [effect for effect in printed.LIBRARY if effect.kind == "physics"]
    assert {other for effect in physics for other in effect.confusable} <= names


def test_means_are_over_whole_steps_and_stamped_at_their_middle():
    time_s = np.arange(0.0, 1.5, 0.01)
    found = printed._means(signal(time_s, np.floor(time_s / 0.5), "N"))
    assert found.time_s == pytest.approx([0.25, 0.75, 1.25])
    assert found.value == pytest.approx([0.0, 1.0, 2.0])
    gap = printed._means(signal(np.array([0.1, 1.2]), np.array([5.0, 6.0]), "N"))
    assert gap.time_s == pytest.approx([0.25, 1.25])


def test_the_model_predicts_a_recording_of_its_own():
    model = printed.model(without=("pivot arm",))
    assert "pivot arm" not in {effect.name for effect in model.effects}
    time_s = np.arange(0.25, 20.0, printed.STEP_S)
    known = {name: np.full(time_s.size, 0.1) for name in model.inputs}
    recording = Recording("made", {n: signal(time_s, v, "1") for n, v in known.items()}, {"payload": LOAD})
    from discrepancy.model.description import Window

    window = Window(
        recording="made",
        start_s=0.0,
        end_s=20.0,
        time_s=time_s,
        step_s=printed.STEP_S,
        known=known,
        constants=recording.constants,
    )
    seen = model.simulate(window, {}, {})
    assert set(seen) == set(model.outputs)
    raised = model.simulate(window, {"zero.specific_force_y": 0.5}, {})
    assert raised["specific_force_y"] - seen["specific_force_y"] == pytest.approx(np.full(time_s.size, 0.5))
    heavier = model.simulate(dataclasses.replace(window, constants={"payload": LOAD + 1000.0}), {}, {})
    assert np.all(heavier["normal_force_front_left"] > seen["normal_force_front_left"])
