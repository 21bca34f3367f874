"""A recording whose answers differ because of an injected fault: the fault is named, and nothing is judged."""

import pytest

from hil.faults.record import Injected
from hil.replay.command import cause_among, heard_by_ecu
from hil.rundir import BUS, ECU_BUS

DROP = Injected(1, "drop WheelSpeeds", 2.0, 3.0, 17)


@pytest.mark.parametrize(("at_s", "named"), [(1.99, False), (2.0, True), (2.5, True), (9.0, True)])
def test_only_a_fault_that_had_begun_can_be_the_cause(at_s, named):
    """Also one that is over: an estimator remembers."""
    assert ("drop WheelSpeeds (from 2.00 s)" in cause_among([DROP], at_s)) == named


def test_without_faults_there_is_no_cause():
    assert cause_among([], 5.0) == ""


def test_behind_a_gateway_the_bus_of_the_ecu_is_replayed(tmp_path):
    assert heard_by_ecu(tmp_path).name == BUS
    (tmp_path / ECU_BUS).touch()
    assert heard_by_ecu(tmp_path).name == ECU_BUS
