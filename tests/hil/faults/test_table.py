"""A fault's table is right, or one line says what is wrong, where, and what is permitted."""

import pytest

from configuration import ConfigurationError
from hil.faults.table import KINDS, faults_of, matching
from plant.unit.scenario import load_scenario
from tests.hil.faults.traffic import DATABASE, MS, fault

GOOD = {
    "drop": {"message": "WheelSpeeds", "probability": 0.1},
    "repeat": {"message": "Limits", "copies": 2, "gap_ms": 1.0},
    "delay": {"message": "*", "delay_ms": 5.0, "from": "ecu"},
    "jitter": {"message": "BodyRates", "jitter_ms": 5.0},
    "reorder": {"message": "BodyRates", "depth": 2},
    "corrupt": {"message": "BodyRates", "bits": 3, "valid_crc": True},
    "freeze": {"message": "BodyRates", "signal": "YawRate"},
    "offset": {"message": "BodyRates", "signal": "YawRate", "offset": 5, "unit": "deg/s"},
    "spike": {"message": "LiftPressure", "signal": "LiftCylinderPressure", "height": 2000.0, "every": 10},
    "swap": {"message": "WheelSpeedsRear", "signals": ["Left", "Right"]},
    "babble": {"from": "plant", "interval_us": 300.0},
    "bus_off": {"node": "ecu"},
    "kill": {"process": "ecu"},
}


def test_every_kind_has_an_example_here():
    assert set(GOOD) == set(KINDS)


@pytest.mark.parametrize("kind", GOOD)
def test_a_good_table_is_read(kind):
    read = fault(kind=kind, at_s=1.5, for_s=0.25, **GOOD[kind])
    assert (read.kind, read.at_ns, read.for_ns) == (kind, 1500 * MS, 250 * MS)
    assert read.label.startswith(kind)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"kind": "dorp"}, "fault.kind = 'dorp' is no kind of fault; did you mean 'drop'?"),
        ({"kind": "drop", "probability": 1.5}, "fault.probability = 1.5 of 1 is outside 0..1 of 1"),
        (
            {"kind": "drop", "probabilty": 0.5},
            "fault.probabilty is not a known key; did you mean 'probability'?",
        ),
        ({"kind": "drop", "for_s": 0}, "fault.for_s = 0 s is outside 0.001..86400 s"),
        ({"kind": "drop", "at_s": -1}, "fault.at_s = -1 s is outside 0..86400 s"),
        ({"kind": "drop", "message": "WheelSpeed_"}, "did you mean 'WheelSpeedsRear'?"),
        ({"kind": "drop", "from": "hub"}, "fault.from = 'hub' is not one of plant, ecu"),
        (
            {"kind": "drop", "message": "Limits", "from": "plant"},
            "fault.from = 'plant', but Limits comes from ecu",
        ),
        ({"kind": "delay"}, "fault.delay_ms is missing"),
        ({"kind": "delay", "delay_ms": "5"}, "fault.delay_ms = '5' is not a number of ms"),
        ({"kind": "freeze", "signal": "Left"}, "fault.message is missing: a signal belongs to a message"),
        (
            {"kind": "freeze", "message": "BodyRates", "signal": "Yaw"},
            "fault.signal = 'Yaw' is no signal of BodyRates; it has Crc, AliveCounter, RollRate",
        ),
        (
            {"kind": "offset", "message": "BodyRates", "signal": "YawRate", "offset": 5.0, "unit": "rad/s"},
            "fault.unit = 'rad/s' is not the unit of YawRate, 'deg/s'",
        ),
        (
            {"kind": "offset", "message": "BodyRates", "signal": "YawRate", "offset": 500.0},
            "fault.offset = 500.0 deg/s is outside -327.67..327.67 deg/s",
        ),
        ({"kind": "swap", "message": "BodyRates", "signals": ["YawRate"]}, "is not a list of 2 texts"),
        (
            {"kind": "swap", "message": "WheelSpeedsFront", "signals": ["Left", "LeftState"]},
            "Left and LeftState are coded differently",
        ),
        ({"kind": "babble", "message": "WheelSpeeds"}, "a babbling node has one identifier"),
        ({"kind": "babble", "identifier": 4096}, "fault.identifier = 4096 is outside 0..2047"),
        ({"kind": "corrupt", "valid_crc": 1}, "fault.valid_crc = 1 is neither true nor false"),
        ({"kind": "bus_off", "node": "ecu", "message": "Limits"}, "fault.message is not a known key"),
        ({"kind": "kill", "process": "hub"}, "fault.process = 'hub' is not one of plant, ecu"),
    ],
)
def test_what_is_wrong_is_named(table, said):
    with pytest.raises(ConfigurationError) as error:
        fault(**table)
    assert str(error.value).startswith("test: fault")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_names_mean_a_message_a_beginning_or_a_pattern():
    def names(pattern):
        return [codec.name for codec in matching(pattern, DATABASE)]

    assert names("Articulation") == ["Articulation"]
    assert names("WheelSpeeds") == ["WheelSpeedsFront", "WheelSpeedsRear"]
    assert names("*Rear") == ["WheelSpeedsRear", "WheelTorquesRear"]
    assert names("Nothing") == []


SCENARIO = """
name = "faulty"
sentence = "A standing machine and a broken sensor."
duration_s = 1.0
machine = "l60"

[driver.brake_percent]
points = [[0.0, 50.0]]
"""
FAULTS = """
[[fault]]
kind = "drop"
message = "BodyRates"
at_s = 0.5

[[fault]]
kind = "bus_off"
node = "plant"
at_s = 0.7
for_s = 0.1
"""


def test_the_plant_leaves_the_faults_of_a_scenario_to_the_bench(tmp_path):
    file = tmp_path / "faulty.toml"
    file.write_text(SCENARIO + FAULTS)
    assert load_scenario(file).duration_s == 1.0
    assert [f.kind for f in faults_of(file, DATABASE)] == ["drop", "bus_off"]


def test_a_scenario_without_faults_has_none_and_a_file_of_faults_has_nothing_else(tmp_path):
    file = tmp_path / "faulty.toml"
    file.write_text(SCENARIO)
    assert faults_of(file, DATABASE) == ()
    with pytest.raises(ConfigurationError, match=r"faulty\.toml: fault is missing"):
        faults_of(file, DATABASE, alone=True)
    file.write_text(SCENARIO + FAULTS)
    with pytest.raises(ConfigurationError, match="name is not a known key"):
        faults_of(file, DATABASE, alone=True)


def test_the_number_of_the_table_is_in_the_error(tmp_path):
    file = tmp_path / "faults.toml"
    file.write_text(FAULTS + '\n[[fault]]\nkind = "delay"\n')
    with pytest.raises(ConfigurationError, match=r"faults\.toml: fault\[2\]\.delay_ms is missing"):
        faults_of(file, DATABASE, alone=True)
