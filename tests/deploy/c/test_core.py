"""The exported C as the core of the bench: the same runs as with Python, and what it refuses."""

import errno
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from bus.cache_folder import NoCacheFolderError
from bus.frame import Frame
from bus.wire import Wire
from dbc import loader_database
from dbc.protection import Finding as Check
from dbc.protection import Protector
from deploy.c import core, library
from deploy.c.core import AUTO, C, CEcu, NotInCError, NotLoadedError
from deploy.c.library import NoCompilerError
from ecu.core import PYTHON
from ecu.cycle import EcuCycle
from ecu.findings import EstimatorFailed, Implausible, ProtectionFailed, Stale, StateChanged
from ecu.states import State
from hil import rundir
from hil.compose import Choice, lockstep, plant_unit
from hil.ecu_side import ecu_cycle
from hil.lockstep import Lockstep
from hil.runs import run_lockstep
from loaderhil.options import checked_core
from plant.unit.scenario import FOLDER
from tests.bus.rows import table_of
from tests.deploy.c.building import STRICT, build, compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.random_drives import RandomDrive
from tests.deploy.c.test_ecu_in_c import moving
from tests.ecu.machine import FakeMachine

SCENARIOS = sorted(file.stem for file in FOLDER.glob("*.toml") if file.stem not in ("loaded", "unloaded"))
"""Without the two long drive cycles, whose frames `make microcontroller` compares."""
FAULTS = """
[[fault]]
kind = "kill"
process = "ecu"
at_s = 0.5
for_s = 0.3

[[fault]]
kind = "drop"
message = "BodyRates"
at_s = 1.2
for_s = 0.4

[[fault]]
kind = "corrupt"
message = "Articulation"
at_s = 1.9
for_s = 0.2
"""


@pytest.fixture(autouse=True)
def _compiler():
    compiler()


def recorded(folder, core, **choice):
    """The files of a lockstep run, without what a clock or the choice of the core puts into run.json."""
    run_lockstep(Choice(core=core, **choice), folder)
    record = json.loads((folder / rundir.RECORD).read_text())
    assert record.pop("ecu_core") == core.name
    del record["started"]
    return record, {file.name: file.read_bytes() for file in folder.iterdir() if file.name != rundir.RECORD}


def test_a_run_with_faults_leaves_the_same_files(tmp_path):
    """Byte for byte: bus, truth, faults; and the same counts of findings in run.json. The ECU is killed and comes back without a state."""
    faults = tmp_path / "faults.toml"
    faults.write_text(FAULTS)
    choice = {"scenario": "abrupt_articulation", "changes": ("duration_s=2.5",), "inject": faults}
    ours, files = recorded(tmp_path / "c", C, **choice)
    theirs, expected = recorded(tmp_path / "python", PYTHON, **choice)
    assert ours == theirs
    assert {"ecu_finding_Stale", "ecu_finding_StateChanged", "ecu_finding_ProtectionFailed"} <= ours[
        "statistics"
    ].keys()
    assert files == expected


@pytest.mark.parametrize("limits", [True, False])
def test_frames_as_rows_leave_the_same_run(limits):
    """Without a wire of its own a run hands on rows; without limits this one rolls over, and the ECU has findings."""
    recordings = []
    for wire in (None, Wire()):
        scenario = Choice(scenario="abrupt_articulation", changes=("duration_s=8.0",)).load()
        ecu = ecu_cycle(form="corrected", limits=limits, core=C)
        bench = Lockstep(plant_unit(scenario), ecu, wire=wire)
        parts = [bench.take() for _ in range(150) if bench.step() is None]  # taken in parts at first
        bench.run()
        parts.append(bench.take())
        recordings.append(
            [
                [str(one) for part in parts for one in getattr(part, kind)]
                for kind in ("bus", "reference", "plant_findings", "ecu_findings")
            ]
        )
        recordings[-1].append([one.row.tolist() for part in parts for one in part.truth])
    assert recordings[0][0]
    assert recordings[0] == recordings[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "limits"),
    # without limits the second one rolls over: estimates contradict themselves for seconds
    [
        *((scenario, True) for scenario in SCENARIOS),
        ("high_articulation", False),
        ("abrupt_articulation", False),
    ],
)
def test_a_scenario_is_the_same_run(scenario, limits):
    chosen = Choice(scenario=scenario).load()
    ours, theirs = (lockstep(chosen, limits=limits, core=core).run() for core in (C, PYTHON))
    assert ours.bus == theirs.bus
    assert ours.reference == theirs.reference
    assert ours.ecu_findings == theirs.ecu_findings
    assert [row.row.tolist() for row in ours.truth] == [row.row.tolist() for row in theirs.truth]


def said(findings):
    """Findings as text: a value that is not a number equals no other. Of failed estimators the words differ."""
    return ["failed" if isinstance(f, EstimatorFailed) else str(f) for f in findings]


@pytest.mark.parametrize("seed", range(2))
def test_c_sends_and_finds_what_python_does(seed):
    """Random drives that run, fail and recover: every frame, and every finding with its words, in the same order."""
    python, c = PYTHON.ecu(CALIBRATION), C.ecu(CALIBRATION)
    seen, states = Counter(), Counter()
    for frame, now in RandomDrive(CALIBRATION, seed).calls(12_000):
        if frame is not None:
            expected = python.receive(frame, now)
            assert said(c.receive(frame, now)) == said(expected)
            seen.update(map(type, expected))
            continue
        ours, theirs = c.tick(now), python.tick(now)
        assert [f[:2] for f in ours.frames] == [f[:2] for f in theirs.frames]
        assert said(ours.findings) == said(theirs.findings)
        assert c.state is python.state
        seen.update(map(type, theirs.findings))
        states[c.state] += 1
    assert {ProtectionFailed, Implausible, Stale, StateChanged} <= seen.keys()
    # a comparison of two ECUs that stand still in FAULT would say little
    assert states[State.RUNNING] > 0.2 * states.total()
    assert states[State.DEGRADED] > 0.1 * states.total()


@pytest.mark.parametrize("ticks", [1, 4], ids=["a cycle's frames", "more than one call takes"])
def test_frames_handed_over_together_are_frames_handed_over_one_by_one(ticks):
    """Random drives: what is sent, and every finding with its words and time, in the same order."""
    single, together = C.ecu(CALIBRATION), C.ecu(CALIBRATION)
    waiting, expected, seen, count, most = [], [], Counter(), 0, 0
    for frame, now in RandomDrive(CALIBRATION, 3).calls(6_000):
        if frame is not None:
            waiting.append(frame._replace(at_ns=now))
            expected += single.receive(frame, now)
            continue
        count += 1
        if count % ticks:  # this cycle is left out, on both sides
            continue
        theirs = single.tick(now)
        rows, sent, findings = together.cycle_rows(
            table_of(waiting)[:], now
        )  # a part of a table, as a bench hands it over
        answers = zip(rows.can_id[:sent].tolist(), rows.length[:sent].tolist(), rows.data[:sent], strict=True)
        assert [Frame(can_id, bytes(data[:length])) for can_id, length, data in answers] == theirs.frames
        assert said(findings) == said([*expected, *theirs.findings])
        seen.update(map(type, findings))
        most = max(most, len(waiting))
        waiting, expected = [], []
    assert {ProtectionFailed, Implausible, StateChanged} <= seen.keys()
    assert (most > 32) == (ticks > 1)


def test_a_frame_signed_as_another_message_is_masqueraded():
    """The C refuses it as it refuses a damaged one; the finding says which of the two it was."""
    machine, codecs = FakeMachine(), loader_database().by_name
    frame = next(f for f in machine.frames() if f.can_id == codecs["BodyRates"].can_id)
    foreign = frame._replace(data=Protector(codecs["BodyAcceleration"]).protect(frame.data))
    (found,) = C.ecu(CALIBRATION).receive(foreign, 0)
    assert found == ProtectionFailed("BodyRates", Check.MASQUERADED, 0)


def test_two_ecus_know_nothing_of_each_other():
    one, other, machine = C.ecu(CALIBRATION), C.ecu(CALIBRATION), FakeMachine()
    for k in range(40):
        moving(machine, k)
        for frame in machine.frames():
            one.receive(frame, machine.now_ns)
        one.tick(machine.now_ns)
    assert one.state is not State.INIT
    assert other.state is State.INIT
    silent = PYTHON.ecu(CALIBRATION)
    assert [f[:2] for f in other.tick(0).frames] == [f[:2] for f in silent.tick(0).frames]


def test_what_is_not_in_c_is_refused():
    with pytest.raises(NotInCError, match="not in the ECU's C core"):
        C.ecu(CALIBRATION, form="printed")


def test_without_a_compiler_one_line_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(library, "code_folder", lambda *_: tmp_path)
    with pytest.raises(NoCompilerError, match=r"needs a C compiler.*cc, gcc, clang") as error:
        C.ecu(CALIBRATION)
    assert "\n" not in str(error.value)


def test_a_compiler_that_fails_is_named_with_its_first_error(monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho 'x.c:1: error: no headers' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    monkeypatch.setattr(library, "code_folder", lambda *_: tmp_path)
    with pytest.raises(NoCompilerError, match=r"cc cannot compile .* no headers"):
        C.ecu(CALIBRATION)


def test_what_was_built_is_not_built_again(monkeypatch):
    first = library.library(CALIBRATION)
    monkeypatch.setattr(library, "_build", lambda *_: pytest.fail("built again"))
    assert library.library(CALIBRATION) == first


def test_auto_takes_c_where_it_was_built_and_never_builds_it(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "code_folder", lambda *_: tmp_path)
    assert AUTO.computing(CALIBRATION, "corrected") == "python"
    assert isinstance(AUTO.ecu(CALIBRATION), EcuCycle)
    assert list(tmp_path.iterdir()) == []
    library.library(CALIBRATION)
    assert AUTO.computing(CALIBRATION, "corrected") == "c"
    assert isinstance(AUTO.ecu(CALIBRATION), CEcu)
    # the C does not have the printed equations
    assert AUTO.computing(CALIBRATION, "printed") == "python"
    assert isinstance(AUTO.ecu(CALIBRATION, form="printed"), EcuCycle)
    # a debugger steps through Python
    monkeypatch.setattr(core, "IN_PYTHON", True)
    assert AUTO.computing(CALIBRATION, "corrected") == "python"
    assert isinstance(AUTO.ecu(CALIBRATION), EcuCycle)


def test_auto_is_python_in_real_time():
    assert checked_core("auto") is AUTO
    assert checked_core("auto", lockstep=False) is PYTHON
    assert checked_core("c", lockstep=False) is C


def test_auto_needs_no_place_for_compiled_code(monkeypatch):
    def nowhere(*_):
        raise NoCacheFolderError("no folder can be written to")

    monkeypatch.setattr(library, "code_folder", nowhere)
    assert AUTO.computing(CALIBRATION, "corrected") == "python"


def test_on_a_full_disk_auto_goes_on_with_python_and_c_says_why(monkeypatch):
    library.library(CALIBRATION)

    def full(**_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(core.tempfile, "NamedTemporaryFile", full)
    assert isinstance(AUTO.ecu(CALIBRATION), EcuCycle)
    with pytest.raises(NotLoadedError, match="cannot be loaded: No space left") as error:
        C.ecu(CALIBRATION)
    assert "\n" not in str(error.value)


def test_the_record_of_a_run_says_what_computed(monkeypatch, tmp_path):
    library.library(CALIBRATION)
    choice = Choice(scenario="standstill", changes=("duration_s=0.1",), core=AUTO)
    assert choice.record(choice.load(), "lockstep").ecu_core == "c"
    monkeypatch.setattr(library, "code_folder", lambda *_: tmp_path)
    assert choice.record(choice.load(), "lockstep").ecu_core == "python"


def test_another_number_of_the_calibration_is_another_library():
    limits = CALIBRATION.limits
    other = type(CALIBRATION)(
        **{name: getattr(CALIBRATION, name) for name in CALIBRATION.__dataclass_fields__ if name != "limits"},
        limits=type(limits)(**{n: getattr(limits, n) for n in limits.__dataclass_fields__ if n != "safe_speed"}, safe_speed=1.0),
    )  # fmt: skip
    assert library.library(other) != library.library(CALIBRATION)


@pytest.mark.parametrize("options", [(), ("-DECU_DOUBLE",)], ids=["single", "double"])
def test_findings_compile_without_a_warning(ecu_sources, tmp_path, options):
    sources = sorted([*ecu_sources.glob("*.c"), *ecu_sources.glob("library/*.c")])
    build(
        sources,
        tmp_path / "ecu.so",
        *STRICT,
        "-shared",
        "-fPIC",
        f"-I{ecu_sources}",
        "-DECU_FINDINGS",
        "-DECU_SETTABLE",
        *options,
    )


@pytest.mark.processes
def test_the_command_line_takes_a_core(tmp_path):
    def run(*words):
        command = [sys.executable, "-m", "loaderhil", "run", "standstill", "--set", "duration_s=0.2", *words]
        return subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env={**os.environ, "COLUMNS": "200"},
        )

    done = run("--ecu-core", "c", "--out", "run")
    assert json.loads((tmp_path / "run" / "run.json").read_text())["ecu_core"] == "c", done.stderr
    refused = run("--ecu-core", "rust")
    assert (refused.returncode, "python, c" in refused.stderr) == (2, True)
    refused = run("--ecu-core", "c", "--form", "printed", "--out", "other")
    assert (refused.returncode, "--form printed: not in the ECU's C core" in refused.stderr) == (2, True)
    assert not Path(tmp_path / "other").exists()


def test_frames_of_other_nodes_are_ignored():
    c = C.ecu(CALIBRATION)
    for codec in loader_database().by_name.values():
        if "EstimatorEcu" in codec.senders:
            assert not c.receive(Frame(codec.can_id, bytes(64)), 0)
