"""Which witness detects what: the mechanisms are those that the findings name, and the printed table is current."""

from pathlib import Path

import pytest

from dbc.protection import Finding as Check
from ecu.findings import Implausible, ProtectionFailed, Stale, StateChanged
from ecu.states import Event, State
from hil.faults.table import KINDS
from plant.unit.reception import Finding as MachineFinding
from studies.soak.detection_matrix import CASES, UNDETECTED, markdown, try_all
from studies.soak.handbook import renewed
from studies.soak.watch import OF_CHECK, Mechanism, Witness, of_ecu, of_machine
from tests.conftest import ROOT

PAGE = Path("docs/reference/faults.md")
ECU, MACHINE, BENCH = Witness


def detected(**table):
    (tried,) = try_all([table])
    return tried


def test_every_class_of_faults_is_tried():
    assert {case["kind"] for case in CASES} == set(KINDS)


def test_every_failed_check_is_a_mechanism():
    passing = {Check.OK, Check.INITIAL, Check.WRONG_LENGTH}  # no fault changes a length
    assert set(OF_CHECK) == set(Check) - passing


def test_findings_become_detections():
    assert of_ecu(ProtectionFailed("X", Check.WRONG_CRC, 5)).mechanism is Mechanism.CRC
    assert of_ecu(Stale("rates", 5)).mechanism is Mechanism.TIMEOUT
    assert of_ecu(Implausible("X", "Y", 1.0, "too far", 5)).mechanism is Mechanism.PLAUSIBILITY
    assert of_ecu(StateChanged(State.RUNNING, State.DEGRADED, Event.INPUTS_BAD, 5)) is None
    assert of_machine(MachineFinding("Limits", Check.REPEATED, 5)).mechanism is Mechanism.COUNTER


def test_a_silent_sensor_is_detected_by_its_age_and_the_ecu_degrades():
    """Three cycles of 10 ms after the last frame, which came 10 ms before the first lost one."""
    tried = detected(kind="drop", message="BodyRates")
    assert 20 <= tried.first_ms[ECU, Mechanism.TIMEOUT] <= 31
    assert (BENCH, Mechanism.DEADLINE) in tried.first_ms
    assert tried.degraded


def test_the_machine_detects_missing_limits():
    tried = detected(kind="drop", message="Limits")
    assert (MACHINE, Mechanism.TIMEOUT) in tried.first_ms
    assert not any(who is ECU for who, _ in tried.first_ms)
    assert not tried.degraded


def test_a_fault_that_does_nothing_is_detected_by_nobody():
    tried = detected(kind="drop", message="BodyRates", probability=0.0)
    assert not tried.detected
    assert UNDETECTED in markdown([tried])


def test_the_printed_table_is_current():
    """scripts/fault-docs writes it."""
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    assert renewed(text) == text


def test_a_page_without_a_place_for_the_table_is_refused():
    with pytest.raises(ValueError, match="has no lines"):
        renewed("# Faults\n")


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_is_explained(kind):
    assert f"| `{kind}` |" in (ROOT / PAGE).read_text(encoding="utf-8")
