"""The table of signals fits the truth and the DBC, row by row."""

import numpy as np
import pytest

from dbc import loader_database, reference_database
from dbc.units import factor_to
from plant.truth import Truth
from plant.unit import interface
from plant.unit.sensors import Readings
from plant.unit.signals import COMPUTED, INTERNALS, OWN, REFERENCES, SENSORS, STATES, family_slice


def test_rows_name_existing_parts_of_the_truth():
    for row in (*SENSORS, *REFERENCES):
        assert 0 <= row.component < row.part.size, row.name


def test_every_signal_has_one_source_and_the_unit_of_its_dbc():
    machine = [(place, row.family.si) for row in SENSORS for place in row.signals]
    machine += [(row.signal, row.unit) for row in INTERNALS]
    rig = [(row.signal, row.unit) for row in (*REFERENCES, *COMPUTED)]
    for database, rows in ((loader_database(), machine), (reference_database(), rig)):
        assert len({place for place, _ in rows}) == len(rows)
        for place, unit in rows:
            message, _, signal = place.partition(".")
            assert factor_to(unit, database.by_name[message].by_signal[signal].unit) > 0.0


def test_channels_of_a_family_stand_together():
    for family in {row.family for row in SENSORS}:
        assert all(row.family is family for row in SENSORS[family_slice(family)])


def test_a_shared_state_is_the_worst_of_its_channels():
    sent = interface.MachineValues()
    for state, channels in STATES.items():
        for worst in channels:
            health = np.zeros(len(SENSORS), np.int64)
            health[[row.name == worst for row in SENSORS]] = 2
            values = sent.of(Readings(np.zeros(len(SENSORS)), health), np.zeros(OWN)).tolist()
            named = dict(zip(interface.MACHINE_SOURCES, values, strict=True))
            assert {name: value for name, value in named.items() if value} == {state: 2.0}


def test_the_satellite_receiver_sees_speed_and_course_over_ground():
    row = np.zeros(Truth.size)
    row[Truth.velocity.at : Truth.velocity.at + 3] = 3.0, 4.0, 1.0
    row[Truth.yaw.at] = 6.0
    sent = dict(
        zip(interface.REFERENCE_SOURCES, interface.reference_values([Truth(row)])[0].tolist(), strict=True)
    )
    assert sent["ground_speed"] == pytest.approx(5.0)
    assert sent["course"] == pytest.approx((6.0 + np.arctan2(4.0, 3.0)) % (2.0 * np.pi))
    assert sent["yaw"] == pytest.approx(6.0 - 2.0 * np.pi)
