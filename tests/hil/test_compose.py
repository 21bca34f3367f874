"""A lockstep bench put together from a choice."""

import pytest

from configuration import CheckedTable
from dbc import loader_database
from ecu.findings import FaultFound
from hil.compose import Choice, lockstep
from hil.faults.injector import Injector
from hil.faults.table import read_fault

SHIFTED = {"kind": "offset", "message": "WheelSpeedsFront", "signal": "Left", "offset": 1.0, "at_s": 1.0}
"""Seven times the smallest offset that the detection finds (docs/results/faults.md), and within what a wheel can reach."""


@pytest.mark.parametrize("detect_faults", [False, True])
def test_the_ecu_of_a_lockstep_detects_faults_of_sensors_on_request(detect_faults):
    scenario = Choice(scenario="loaded", changes=("duration_s=2.0",)).load()
    fault = read_fault(CheckedTable(SHIFTED, file="test"), loader_database())
    injector = Injector(loader_database(), [fault], seed=1)
    recording = lockstep(scenario, reference=False, injector=injector, detect_faults=detect_faults).run()
    found = [finding.signals for finding in recording.ecu_findings if isinstance(finding, FaultFound)]
    assert found == ([("wheel_speed_1",)] if detect_faults else [])
