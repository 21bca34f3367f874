"""A calibration is read in SI, and a fault in one is reported in one line: file, key, value, unit, range."""

import math

import pytest

from bus.user_error import UserError
from configuration import ConfigurationError
from ecu.calibration import CALIBRATIONS, load_calibration

TEXT = (CALIBRATIONS / "l60.toml").read_text()


def edited(folder, old, new):
    """A calibration file in which one line differs."""
    assert TEXT.count(old) == 1, f"{old!r} is there {TEXT.count(old)} times"
    file = folder / "machine.toml"
    file.write_text(TEXT.replace(old, new))
    return file


def test_every_shipped_calibration_is_read():
    for file in CALIBRATIONS.glob("*.toml"):
        assert load_calibration(file.stem) == load_calibration(file)


def test_units_of_the_keys_become_si():
    c = load_calibration()
    assert c.parameters.geometry.articulation_stop == pytest.approx(math.radians(40))
    assert c.parameters.wheel.front_pressure == pytest.approx(3.5e5)
    assert c.parameters.contact.damping == pytest.approx(6000)
    assert c.parameters.prediction.step == pytest.approx(0.04)
    assert c.limits.safe_speed == pytest.approx(8 / 3.6)
    assert c.limits.rate_rise == pytest.approx(math.radians(15))
    assert c.inputs.pressure == pytest.approx(38e6)
    area = 2 * math.pi / 4 * 0.110**2
    assert c.parameters.cylinders.head_area == pytest.approx(area)


FAULTS = {
    "a key that is not known": (
        "horizon_s = 1.2",
        "horizont_s = 1.2",
        ["prediction.horizont_s", "'horizon_s'"],
    ),
    "a key that is missing": ("imu_x_m = -0.50\n", "", ["sensors.imu_x_m", "missing", "-5..5 m"]),
    "a value out of range": ("imu_x_m = -0.50", "imu_x_m = 50.0", ["sensors.imu_x_m = 50.0 m", "-5..5 m"]),
    "a text for a number": (
        "imu_x_m = -0.50",
        'imu_x_m = "left"',
        ["sensors.imu_x_m", "'left'", "number of m"],
    ),
    "true for a number": ("imu_x_m = -0.50", "imu_x_m = true", ["sensors.imu_x_m", "number of m"]),
    "not a number": ("imu_x_m = -0.50", "imu_x_m = nan", ["sensors.imu_x_m", "nan", "-5..5 m"]),
    "an unknown table": ("[contact]", "[contcat]", ["contcat", "known", "contact"]),
    "no name": ('name = "l60"', "", ["name is missing"]),
    "swapped diameters": (
        "rod_mm = 70.0",
        "rod_mm = 170.0",
        ["cylinders.rod_mm = 170 mm", "110 mm", "swapped"],
    ),
    "halves on the wrong sides": ("x_m = -1.175", "x_m = 1.175", ["rear.x_m = 1.175 m", "front.x_m"]),
    "thresholds in the wrong order": (
        "warning_margin = 0.18",
        "warning_margin = 0.6",
        ["warnings.warning_margin = 0.6", "warnings.attention_margin = 0.45"],
    ),
    "hysteresis upside down": (
        "release_margin = 0.50",
        "release_margin = 0.20",
        ["limits.engage_margin = 0.35", "limits.release_margin = 0.2"],
    ),
    "no TOML": ('name = "l60"', "name = l60", ["not valid TOML", "line"]),
    "an impossible delay": (
        "least_on_ms = 500.0",
        "least_on_ms = -1",
        ["alarms.least_on_ms = -1 ms", "0..5000 ms"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_reported_in_one_line_with_file_and_key(fault, tmp_path):
    old, new, words = FAULTS[fault]
    file = edited(tmp_path, old, new)
    with pytest.raises(ConfigurationError) as caught:
        load_calibration(file)
    message = str(caught.value)
    assert isinstance(caught.value, UserError)
    assert isinstance(caught.value, ValueError)
    assert message.startswith(str(file))
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_table_without_its_source_is_refused(tmp_path):
    lines = TEXT.splitlines()
    at = lines.index("[contact]") + 1
    assert lines[at].startswith("source")
    file = tmp_path / "machine.toml"
    file.write_text("\n".join(lines[:at] + lines[at + 1 :]))
    with pytest.raises(ConfigurationError, match=r"contact\.source is missing: say where"):
        load_calibration(file)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ConfigurationError, match="no calibration named 'l90'; known: compact, l60"):
        load_calibration("l90")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"gone\.toml: cannot be read"):
        load_calibration(tmp_path / "gone.toml")


def test_a_file_that_is_not_text_is_refused(tmp_path):
    file = tmp_path / "binary.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_calibration(file)
