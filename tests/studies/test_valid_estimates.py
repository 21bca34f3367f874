"""What a frame calls valid is right, also after a wheel has lifted: the whole chain from the plant to the frame."""

import numpy as np
import pytest

from hil.compose import Choice, lockstep
from hil.verdict import first_lift_off
from plant.truth import columns_of as truth_of
from studies.campaigns.memory import columns_of

WHEELS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
LOAD_KN, FORCE_KN, SLIP, RATIO = 3.0, 3.0, 0.03, 0.1
"""Bounds of a valid load, tyre force, slip, and ratio. A standing wheel carries 28 kN."""
MOMENT_KN_M, TORQUE_KN_M, PAYLOAD_KG = 12.0, 6.0, 200.0
FRONT_RATIO = 0.15
"""The front pair carries half of the weight that all wheels carry."""


@pytest.fixture(scope="module")
def drive():
    """A machine that rolls over without limits: frames by message, and the truth."""
    recording = lockstep(Choice(scenario="abrupt_articulation").load(), limits=False, reference=False).run()
    return columns_of(recording.bus), truth_of(np.array([row.row for row in recording.truth]))


def estimates(true):
    """Message, signal, flag, true values in the signal's unit, and bound."""
    for k, wheel in enumerate(WHEELS):
        force = f"TyreForce{wheel}"
        yield "NormalForces", wheel, f"{wheel}Valid", true["normal_force"][:, k] / 1e3, LOAD_KN
        yield force, "Longitudinal", "ForceValid", true["longitudinal_force"][:, k] / 1e3, FORCE_KN
        yield force, "Lateral", "ForceValid", true["lateral_force"][:, k] / 1e3, FORCE_KN
        yield force, "Slip", "SlipValid", true["slip"][:, k], SLIP
    loads = true["normal_force"]
    front = (loads[:, 1] - loads[:, 0]) / np.maximum(loads[:, 0] + loads[:, 1], 1.0)
    yield "Warnings", "FrontLoadTransferRatio", "FrontLoadTransferRatioValid", front, FRONT_RATIO
    yield "RollOver", "LoadTransferRatio", "Valid", true["load_transfer_ratio"], RATIO
    yield "RollOver", "LiftOffMargin", "Valid", (loads / loads[0]).min(axis=1), RATIO
    yield "TurningTorque", "YawMoment", "MomentValid", true["yaw_moment"] / 1e3, MOMENT_KN_M
    yield "TurningTorque", "JointTorque", "TorqueValid", true["joint_torque"] / 1e3, TORQUE_KN_M
    yield "BodyMotion", "PayloadMass", "PayloadValid", true["payload_mass"], PAYLOAD_KG


def test_a_valid_estimate_is_right_before_and_after_a_lift_off(drive):
    """Slip 4.82 where 2.72 was true, and a lateral force of 70 kN where 15 was, were once valid in this drive."""
    messages, true = drive
    wrong = {}
    for message, signal, flag, values, bound in estimates(true):
        columns = messages[message]
        valid = columns.signals[flag] > 0
        error = np.abs(columns.signals[signal] - np.interp(columns.time_s, true["time_s"], values))
        worst = np.max(np.where(valid, error, 0.0))
        if worst > bound:
            wrong[f"{message}.{signal}"] = worst
    assert wrong == {}


def test_until_the_lift_off_nearly_all_is_valid(drive):
    messages, true = drive
    lift_off_s = first_lift_off(true["time_s"], true["normal_force"])[0]
    for message, _, flag, _, _ in estimates(true):
        columns = messages[message]
        before = (columns.time_s > 0.1) & (columns.time_s < lift_off_s - 0.1)
        assert (columns.signals[flag][before] > 0).all(), f"{message}.{flag}"
