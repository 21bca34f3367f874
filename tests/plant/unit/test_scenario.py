"""Scenario files: what is shipped parses, what is wrong is refused with one clear error."""

import math
import re
from pathlib import Path

import pytest

from configuration import ConfigurationError
from plant.unit.scenario import FOLDER, list_scenarios, load_scenario
from plant.unit.script import wish_at

MINIMAL = """
name = "case"
sentence = "A case."
duration_s = 2.0
machine = "l60"
"""

THESIS_CASES = {
    "transient_torque", "transient_articulation", "unloaded", "loaded", "hard_braking", "high_articulation",
    "abrupt_articulation", "standstill",
}  # fmt: skip


@pytest.fixture
def write(tmp_path):
    """Writes case.toml and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "case.toml"
        path.write_text(text)
        return path

    return write


def test_the_drive_cases_of_the_thesis_are_shipped():
    listed = {summary.name: summary for summary in list_scenarios()}
    assert set(listed) >= THESIS_CASES
    for name, summary in listed.items():
        assert load_scenario(name).name == name
        assert summary.sentence.endswith(".")
        assert summary.path == FOLDER / f"{name}.toml"


def test_the_loaded_case_carries_the_bucket_load_of_the_thesis():
    assert load_scenario("loaded").payload_mass == 3204.0  # thesis table 2


def test_a_minimal_file_stands_still_on_level_asphalt(write):
    scenario = load_scenario(write(MINIMAL))
    assert (scenario.payload_mass, scenario.start.speed, scenario.surface.grade, scenario.surface.bank) == (
        0,
        0,
        0,
        0,
    )
    assert scenario.surface.friction == 0.75  # thesis table 5, asphalt
    wish = wish_at(scenario.script.curves(), 1.0, 0.01)
    assert math.isnan(wish.speed)
    assert math.isnan(wish.articulation_angle)
    assert (wish.torque, wish.articulation_rate) == (0.0, 0.0)
    assert (wish.brake, wish.lift, wish.tilt) == (0, 0, 0)


def test_units_of_the_file_become_si(write):
    scenario = load_scenario(
        write(
            MINIMAL
            + """
[surface]
grade_percent = 100
bank_deg = 9
[start]
speed_kmh = 36
articulation_deg = -30
lift_arm_deg = 45
[driver]
speed_kmh = { points = [[0, 18]] }
articulation_deg = { points = [[0, 0], [1, 30]] }
brake_percent = { points = [[0, 50]] }
lift_percent = { points = [[0, 25]] }
tilt_percent = { points = [[0, -75]] }
[sensors.yaw_rate]
bias_deg_s = 9
"""
        )
    )
    assert scenario.surface.grade == pytest.approx(math.pi / 4)  # 100 % is 45 degrees
    assert scenario.surface.bank == pytest.approx(math.pi / 20)
    assert scenario.start.speed == pytest.approx(10.0)
    assert scenario.start.articulation_angle == pytest.approx(-math.pi / 6)
    assert scenario.start.lift_arm_angle == pytest.approx(math.pi / 4)
    wish = wish_at(scenario.script.curves(), 0.5, 0.01)
    assert wish.speed == pytest.approx(5.0)
    assert wish.articulation_angle == pytest.approx(math.pi / 12)
    assert wish.articulation_angle_rate == pytest.approx(math.pi / 6)
    assert (wish.brake, wish.lift, wish.tilt) == pytest.approx((0.5, 0.25, -0.75))
    assert scenario.equipment.sensors.of("yaw_rate").bias == pytest.approx(math.pi / 20)


def test_the_other_way_to_drive_and_steer_has_its_units_too(write):
    scenario = load_scenario(
        write(
            MINIMAL
            + """
[driver]
torque_percent = { points = [[0, 40]], sine = { amplitude = 10, frequency_hz = 0.5, start_s = 0, end_s = 1 } }
articulation_rate_deg_s = { points = [[0, -18]] }
"""
        )
    )
    wish = wish_at(scenario.script.curves(), 0.5, 0.01)
    assert wish.torque == pytest.approx(0.5)  # a quarter of a period: the sine is at its amplitude
    assert wish.articulation_rate == pytest.approx(-math.pi / 10)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = 'other'\n" + MINIMAL.replace('name = "case"', ""), ["name", "'other'", "'case'"]),
        (MINIMAL.replace("2.0", "0.0"), ["duration_s", "0.0 s", "0.1..3600 s"]),
        (MINIMAL.replace('machine = "l60"', ""), ["machine is missing"]),
        (MINIMAL + "payload_t = 3", ["payload_t", "payload_kg"]),
        (MINIMAL + "[surface]\nfriction = 7.5", ["surface.friction", "7.5", "0.05..1.2"]),
        (MINIMAL + "[start]\nspeed_kmh = 95", ["start.speed_kmh", "95 km/h", "-20..40 km/h"]),
        (MINIMAL + "[start]\nlift_arm_deg = 'up'", ["start.lift_arm_deg", "'up'", "deg"]),
        (MINIMAL + "[driver]\nbrake_percent = 30", ["driver.brake_percent", "30", "table"]),
        (
            MINIMAL + "[driver.speed_kmh]\npoints = [[0, 10], [5, 99]]",
            ["driver.speed_kmh.points[1].value", "99 km/h"],
        ),
        (MINIMAL + "[driver.speed_kmh]\nsine = {}", ["driver.speed_kmh.points is missing"]),
        (
            MINIMAL + "[driver.speed_kmh]\npoints = [[0, 1]]\n[driver.torque_percent]\npoints = [[0, 1]]",
            ["driver.torque_percent", "speed_kmh", "one or the other"],
        ),
        (MINIMAL + "[sensors.yaw]\nbias_deg_s = 1", ["sensors.yaw", "yaw_rate"]),
        (MINIMAL + 'equipment = "l66"', ["equipment", "'l66'", "l60"]),
        (MINIMAL + "seed = -1", ["seed", "-1", "0..4294967295"]),
    ],
)
def test_a_wrong_file_is_one_clear_error(write, text, words):
    with pytest.raises(ConfigurationError) as error:
        load_scenario(write(text))
    assert all(word in str(error.value) for word in words), str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ConfigurationError, match=re.escape("'abrupt'")) as error:
        load_scenario("abrupt")
    assert "abrupt_articulation" in str(error.value)
