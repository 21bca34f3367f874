"""[[expect]] tables: each kind is read, a mistake names file and key, a scenario keeps them for the bench."""

import pytest

from configuration import ConfigurationError
from dbc import loader_database
from plant.unit.scenario import load_scenario
from testbench.expect.table import KINDS, expectations_of

EVERY_KIND = """
[[expect]]
kind = "no_lift_off"
[[expect]]
kind = "no_roll_over"
to_s = 5.0
[[expect]]
kind = "signal"
signal = "BodyMotion.Speed"
maximum = 8.0
ignore_ms = 20
[[expect]]
kind = "state"
is = ["running", "degraded"]
from_s = 1.0
least_percent = 99.0
[[expect]]
kind = "reached"
condition = "RollOver.State >= warning"
to_s = 5.0
for_ms = 50
[[expect]]
kind = "response"
cause = "DriverDemand.BrakeDemand > 10 %"
effect = "Limits.Cause > no_limit"
within_ms = 100
[[expect]]
kind = "reaction"
within_ms = 20
least_percent = 99
[[expect]]
kind = "limits_obeyed"
settle_s = 0.5
[[expect]]
kind = "detected"
fault = "drop WheelSpeeds"
by = "Warnings.InputStale > 0"
within_ms = 300
"""


def read(tmp_path, text, alone=True):
    file = tmp_path / "criteria.toml"
    file.write_text(text)
    return expectations_of(file, loader_database(), alone=alone)


def test_the_old_name_of_a_kind_is_still_read(tmp_path):
    tables = [f'[[expect]]\nkind = "{kind}"\nwithin_ms = 5' for kind in ("noticed", "detected")]
    old, new = read(tmp_path, "\n".join(tables))
    assert old == new
    assert "detected by the ecu" in old.question


def test_every_kind_is_read(tmp_path):
    found = read(tmp_path, EVERY_KIND)
    assert len(found) == len(KINDS)
    assert len({type(each) for each in found}) == len(KINDS)
    assert [each.question for each in found][
        3
    ] == "EcuStatus.State is running or degraded for 99 % of the time from 1 s on"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", r"criteria.toml: expect is missing"),
        ('[[expect]]\nkind = "no_liftoff"', r"expect\[0\].kind = 'no_liftoff' .* did you mean 'no_lift_off'"),
        ('[[expect]]\nkind = "no_lift_off"\nform_s = 1', r"form_s is not a known key; did you mean 'from_s'"),
        ('[[expect]]\nkind = "no_lift_off"\nfrom_s = 2\nto_s = 1', r"to_s = 1 s is outside 2"),
        ('[[expect]]\nkind = "signal"\nsignal = "BodyMotion.Speed"', r"minimum and maximum are missing"),
        ('[[expect]]\nkind = "signal"\nsignal = "BodyMotion.Speed"\nminimum = 2\nmaximum = 1', r"exchanged"),
        ('[[expect]]\nkind = "signal"\nsignal = "Speed"\nminimum = 2', r"write Message.Signal"),
        ('[[expect]]\nkind = "state"', r"is is missing"),
        ('[[expect]]\nkind = "state"\nis = []', r"neither a text or number"),
        ('[[expect]]\nkind = "state"\nis = "runing"', r"its values are init, running"),
        ('[[expect]]\nkind = "detected"\nby = "driver"\nwithin_ms = 5', r"none of ecu, machine, bench"),
        ('[[expect]]\nkind = "reaction"', r"within_ms is missing"),
        ('[[fault]]\nkind = "drop"', r"expect is missing"),
    ],
)
def test_a_mistake_names_file_and_key(tmp_path, text, says):
    with pytest.raises(ConfigurationError, match=says):
        read(tmp_path, text)


def test_a_scenario_may_have_expectations_and_need_not(tmp_path):
    file = tmp_path / "criteria.toml"
    drive = 'name = "criteria"\nsentence = "s"\nduration_s = 1.0\nmachine = "l60"\n'
    file.write_text(drive + '[[expect]]\nkind = "no_lift_off"\n')
    assert load_scenario(file).name == "criteria"
    assert len(expectations_of(file, loader_database())) == 1
    assert read(tmp_path, drive, alone=False) == ()
