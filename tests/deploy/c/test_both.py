"""Python and C in one run: they agree, and where they do not, the first difference is named."""

import json
import re
import sys

import pytest

from bus.frame import Frame
from dbc import loader_database
from deploy.c.both import BOTH, BothCores, BothEcus, CoresDifferError, first_difference
from deploy.c.core import C
from ecu.core import PYTHON
from hil import rundir
from hil.compose import Choice
from hil.ending import Ending
from hil.runs import run_lockstep
from loaderhil.cli import main
from tests.conftest import STANDS
from tests.deploy.c.building import compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.random_drives import RandomDrive

LIMITS = loader_database().by_name["Limits"]


@pytest.fixture(autouse=True)
def _compiler():
    compiler()


@pytest.fixture
def scenario(tmp_path):
    """A scenario that stands for a second."""
    file = tmp_path / "short.toml"
    file.write_text(STANDS.format(duration_s=1.0))
    return str(file)


def driven(ecu, calls=3000):
    """A random drive with lost and damaged frames, for an ECU."""
    for frame, now in RandomDrive(CALIBRATION, 3).calls(calls):
        if frame is not None:
            ecu.receive(frame, now)
        else:
            ecu.executed(1_500_000)
            ecu.tick(now)


def unlimited():
    """Python with limits, C without: what an error in one of the two would look like."""
    return BothEcus(PYTHON.ecu(CALIBRATION), C.ecu(CALIBRATION, limits=False))


def test_both_agree_on_frames_and_findings_of_a_hard_drive():
    driven(BOTH.ecu(CALIBRATION))


def test_a_difference_is_named_by_cycle_message_and_signal():
    with pytest.raises(CoresDifferError) as raised:
        driven(unlimited())
    assert re.match(r"cycle \d+, (Limits|LinkageLimits|Warnings)\.\w+: Python \S+, C \S+$", str(raised.value))


def test_ecus_that_do_not_get_the_same_calls_differ():
    """The time of a cycle is sent: where only one of them is given it, the next status differs."""
    both = BOTH.ecu(CALIBRATION)
    both._c.executed(5_000_000)
    with pytest.raises(CoresDifferError, match=r"EcuStatus\.\w+: Python 0"):
        driven_once(both)


def driven_once(ecu):
    for k in range(20):
        ecu.tick(k * 10_000_000)


@pytest.mark.parametrize(
    ("ours", "theirs", "said"),
    [
        ([Frame(LIMITS.can_id, bytes(8))], [], "Python sends 1 frames, C 0"),
        (
            [Frame(LIMITS.can_id, bytes(8))],
            [Frame(LIMITS.can_id, bytes(7))],
            "Limits: Python sends 8 bytes, C 7",
        ),
        (
            [Frame(LIMITS.can_id, bytes(8))],
            [Frame(loader_database().by_name["EcuStatus"].can_id, bytes(8))],
            "Python sends Limits where C sends EcuStatus",
        ),
        (
            [Frame(LIMITS.can_id, bytes(8))],
            [Frame(LIMITS.can_id, b"\1" + bytes(7))],
            "Limits.Crc: Python 0, C 1",
        ),
        ([Frame(LIMITS.can_id, bytes(8))], [Frame(LIMITS.can_id, bytes(8))], None),
    ],
)
def test_the_first_difference_of_two_answers(ours, theirs, said):
    assert first_difference(ours, theirs) == said


def test_a_run_of_both_is_the_run_of_python(scenario, tmp_path):
    both = run_lockstep(Choice(scenario=scenario, core=BOTH), tmp_path / "both")
    run_lockstep(Choice(scenario=scenario), tmp_path / "python")
    assert (both.ending, both.record.ecu_core) == (Ending.PASSED, "both")
    logs = [(tmp_path / name / rundir.BUS).read_bytes() for name in ("both", "python")]
    assert logs[0] == logs[1]


def test_a_difference_ends_the_command_with_its_name_and_1(scenario, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(BothCores, "ecu", lambda *_, **__: unlimited())
    monkeypatch.setattr(
        sys, "argv", ["loaderhil", "run", scenario, "--ecu-core", "both", "--out", str(tmp_path / "out")]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == Ending.FAILED
    assert re.search(r"loaderhil: cycle \d+, \w+\.\w+: Python ", capsys.readouterr().err)
    record = json.loads((tmp_path / "out" / rundir.RECORD).read_text())
    assert (record["outcome"], record["reason"].startswith("cycle ")) == ("failed", True)


def test_two_cores_are_compared_in_lockstep_only(scenario, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["loaderhil", "run", scenario, "--ecu-core", "both", "--realtime"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == Ending.MISUSED
    assert "lockstep only" in " ".join(capsys.readouterr().err.split())
