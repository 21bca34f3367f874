"""The equipment file: SI inside, nothing missing, nothing unknown."""

import math
import re

import pytest

from configuration import ConfigurationError
from plant.unit.equipment import FOLDER, load_equipment
from plant.unit.signals import CHANNELS

TEXT = (FOLDER / "l60.toml").read_text(encoding="utf-8")


def test_units_of_the_file_become_si():
    equipment = load_equipment("l60")
    assert equipment.rolling_radius == 0.72  # thesis, appendix A
    assert equipment.actuators.peak_power == 60e3
    assert equipment.actuators.service_brake == (14e3, 14e3, 11e3, 11e3)
    assert equipment.obedience.stale_after == 0.05
    assert equipment.obedience.safe.speed == pytest.approx(8 / 3.6)
    assert equipment.obedience.safe.wheel_torque == (8e3,) * 4
    assert equipment.obedience.safe.articulation_rate == pytest.approx(math.radians(10))
    assert equipment.driver.brake_rate == pytest.approx(6.7)
    assert equipment.driver.articulation_rate == pytest.approx(math.radians(27))


def test_every_sensor_has_noise_a_confidence_and_a_source():
    sensors = load_equipment("l60").sensors
    assert all(sensors.of(channel).noise > 0 for channel in CHANNELS)
    sections = re.findall(r"^\[sensors\.(\w+)\]\n((?:\w.*\n)*)", TEXT, flags=re.MULTILINE)
    families = [body for _, body in sections if "noise" in body]
    assert len(families) == 9
    assert all("confidence" in body and "source" in body for body in families)


OPTIONAL = {"lift_rate_deg_s", "tilt_rate_deg_s"}  # equipment files of version 0.1 do not have them
KEYS = [
    key
    for key in re.findall(r"^(\w+_\w+) = ", TEXT.split("[sensors.")[0], flags=re.MULTILINE)
    if key not in OPTIONAL
]


@pytest.mark.parametrize("key", KEYS)
def test_a_missing_key_is_named(tmp_path, key):
    path = tmp_path / "case.toml"
    path.write_text(re.sub(rf"^{key} = .*$", "", TEXT, count=1, flags=re.MULTILINE))
    with pytest.raises(ConfigurationError, match=rf"case\.toml: [\w.]*{key} is missing"):
        load_equipment(path)


@pytest.mark.parametrize(
    "section", ["", "actuators", "limits", "limits.safe_values", "driver", "sensors.pressure"]
)
def test_an_unknown_key_is_named(tmp_path, section):
    path = tmp_path / "case.toml"
    header = f"[{section}]\n"
    path.write_text(TEXT.replace(header, header + "colour = 1\n") if section else "colour = 1\n" + TEXT)
    name = re.escape(f"{section}.colour" if section else "colour")
    with pytest.raises(ConfigurationError, match=rf"case\.toml: {name} is not a known key"):
        load_equipment(path)
