"""Bodies of truth for the loader: what is hidden is in the recording, and nothing else is changed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.loader_mujoco import MujocoMotion
from bench.loader_truth import Arm, arms, hidden, record
from discrepancy.models.loader import model as loader
from discrepancy.models.loader import recorded_run
from plant.effects import find_effect
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.unit.interface import reference_values
from plant.unit.sensors import felt_values, measured_values


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    arm = Arm(seed=5, duration_s=1.5)
    truths = {
        "plain": record(arm, folder / "plain"),
        "again": record(arm, folder / "again"),
        "biased": record(replace(arm, effects=("yaw_rate bias",), scale=2.0), folder / "biased"),
    }
    return folder, truths


def test_equal_arms_give_equal_frames(made):
    folder, truths = made
    assert truths["plain"] == truths["again"]
    assert (folder / "plain" / "bus.log").read_bytes() == (folder / "again" / "bus.log").read_bytes()


def test_a_hidden_bias_is_in_its_channel_and_nowhere_else(made):
    """The bias is in the truth that is returned and, but for the steps of the frame, in the channel."""
    folder, truths = made
    assert truths["biased"]["yaw_rate.bias"] == pytest.approx(
        2.0 * loader.model().parameter("yaw_rate.bias").typical
    )
    plain, biased = (loader.load_run(folder / name).signals for name in ("plain", "biased"))
    shift = biased["yaw_rate"].value - plain["yaw_rate"].value
    np.testing.assert_allclose(shift, truths["biased"]["yaw_rate.bias"], atol=2e-4)
    np.testing.assert_array_equal(biased["roll_rate"].value, plain["roll_rate"].value)


def test_every_arm_of_a_report_is_one_of_the_library():
    model = loader.model()
    for arm in arms():
        assert arm.seed >= 1000
        for name, value in hidden(model, arm).items():
            p = model.parameter(name)
            assert p.lower <= value <= p.upper
            assert p.shape or value != p.value


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"payload_kg": "much"}', '{"payload_kg": -3}'])
def test_a_damaged_record_of_a_run_is_named(tmp_path, text):
    path = tmp_path / "run.json"
    path.write_text(text)
    with pytest.raises(loader.DamagedRecord, match=r"run\.json"):
        recorded_run._constants(path)


def test_without_a_record_nothing_is_known_of_the_day(tmp_path):
    assert recorded_run._constants(tmp_path / "run.json") == {}


def test_mujoco_moves_as_the_plant_does():
    """Two engines, one tyre law and step, payload, drag and a slippery road hidden in both: positions agree to rounding."""
    hidden_in = replace(
        load_machine("l60"),
        effects=(
            find_effect("payload_mass").of(extra_kg=500.0),
            find_effect("brake_drag").of(front_N_m=300.0, rear_N_m=300.0),
            find_effect("surface_friction").of(left=0.5, right=0.5),
        ),
    )
    theirs, ours = (
        MujocoMotion(hidden_in, payload_mass=1000.0, speed=2.0),
        Plant(hidden_in, payload_mass=1000.0, speed=2.0),
    )
    for k in range(100):
        commands = Commands(
            wheel_torque=(2000.0,) * 4,
            articulation_rate=0.2 * math.sin(0.05 * k),
            lift_rate=0.1 if k > 50 else 0.0,
        )
        theirs.advance(commands, 0.01)
        ours.advance(commands, 0.01)
    for name in ("position", "wheel_speed", "oscillation_angle", "lift_arm_angle", "pitch"):
        np.testing.assert_allclose(getattr(theirs.truth(), name), getattr(ours.truth(), name), atol=1e-9)
    # the plant records forces at the instant, MuJoCo's those of the step that follows
    np.testing.assert_allclose(theirs.truth().lift_pressure, ours.truth().lift_pressure, rtol=1e-4)
    np.testing.assert_allclose(theirs.truth().steering_pressure, ours.truth().steering_pressure, rtol=1e-2)
    np.testing.assert_allclose(theirs.truth().imu_specific_force, ours.truth().imu_specific_force, atol=0.01)
    # every sensor of the machine reads the same: one that MuJoCo's motion left out would read 0
    for read in (measured_values, felt_values):
        np.testing.assert_allclose(read(theirs.truth()), read(ours.truth()), rtol=1e-2, atol=0.01)
    assert np.isfinite(reference_values([theirs.truth()])).all()


def test_mujoco_refuses_an_effect_it_cannot_have():
    with pytest.raises(ValueError, match="rolling_resistance"):
        MujocoMotion(
            replace(load_machine("l60"), effects=(find_effect("rolling_resistance").typical(),)),
            payload_mass=0.0,
            speed=0.0,
        )
