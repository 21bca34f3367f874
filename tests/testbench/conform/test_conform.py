"""Conformance: the example and our own ECU conform, and each planted violation is named and nothing else is."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cantools
import numpy as np
import pytest

from bus.frame import EXTENDED, Frame
from dbc import FOLDER, loader_database
from deploy.c.core import C
from ecu.calibration import load_calibration
from ecu.core import PYTHON
from hil.ending import Ending
from hil.results import ending_of
from hil.verdict import Result
from testbench.conform.evidence import Bench, ConformError, Evidence
from testbench.conform.live import keep, kept_bench
from testbench.conform.session import Session, judge
from testbench.restbus.values import values_for
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE
from tests.deploy.c.building import compiler
from tests.examples.test_foreign_nodes import hub, loaderhil, running  # noqa: F401
from tests.testbench.conform.violations import CONFORMING, VIOLATIONS, bent

MS = 1_000_000
DBC = FOLDER / "loader.dbc"
CANTOOLS = cantools.database.load_file(DBC)
GENERATORS = values_for(DBC, None).generators
SWITCHED_ON_MS = 500
processes = [pytest.mark.processes, pytest.mark.timeout(600)]


def session_with(ecu, *, only=("BodyRates",), steady_s=0.5, on_ms=SWITCHED_ON_MS, frames_of=None):
    """A session in virtual time, with an ECU of the example's kind on the other side."""
    frames_of = frames_of or (
        lambda now_ns: [Frame(i | EXTENDED, data) for i, data in ecu.step(now_ns * 1e-9)]
    )
    session = Session(loader_database(), "EstimatorEcu", GENERATORS, start_ns=0, steady_s=steady_s, only=only)
    for ms in range(60_000):
        now_ns = ms * MS
        for frame in session.advance(now_ns):
            if ms >= on_ms:
                ecu.receive(frame.identifier, frame.data, now_ns * 1e-9)
        if ms >= on_ms and ms % 10 == 5:
            session.receive([frame._replace(at_ns=now_ns) for frame in frames_of(now_ns)], now_ns)
        if session.finished:
            return session
    raise AssertionError("the session never ended")


def broken(found):
    """Subject and kind of every requirement that is not passed."""
    return {(each.subject, each.kind.value) for each in found if each.result is Result.FAILED}


def asked(found, subject, kind):
    return next(each for each in found if (each.subject, each.kind.value) == (subject, kind))


@pytest.fixture(scope="module")
def good():
    """The example, tested."""
    return session_with(CONFORMING(CANTOOLS))


class TestTheExample:
    def test_conforms(self, good):
        found = judge(good.evidence())
        assert broken(found) == set()
        # Inputs that this short session did not lose are open; everything else is judged.
        left = {each.kind.value for each in found if each.result is Result.INCONCLUSIVE}
        assert left == {"state after loss", "recovery"}
        assert asked(found, "loss of BodyRates", "state after loss").result is Result.PASSED
        assert asked(found, "loss of all inputs", "state after loss").result is Result.PASSED

    def test_may_leave_out_what_is_optional(self, good):
        found = asked(judge(good.evidence()), "EstimateUncertainty", "presence")
        assert (found.result, found.evidence) == (
            Result.PASSED,
            "never sent, which the DBC permits (SendOptional)",
        )
        assert {e.kind.value for e in judge(good.evidence()) if e.subject == "EstimateUncertainty"} == {
            "presence"
        }

    def test_a_recording_gives_the_verdicts_of_the_live_test(self, good, tmp_path):
        keep(good, Bench(from_start=True, late_ns=3), tmp_path)
        assert kept_bench(tmp_path) == Bench(from_start=True, late_ns=3)
        from dbc.recordings.reading import read_frames

        table = read_frames(tmp_path / "bus.log")
        again = judge(Evidence.of(table, loader_database(), "EstimatorEcu", Bench(from_start=True)))
        live = judge(good.evidence())
        assert [(e.subject, e.kind, e.result) for e in again] == [(e.subject, e.kind, e.result) for e in live]

    def test_a_recording_that_begins_later_leaves_the_start_open(self, good):
        table = good.evidence().table
        found = judge(Evidence.of(table, loader_database(), "EstimatorEcu"))
        assert asked(found, "EstimatorEcu", "start-up").result is Result.INCONCLUSIVE
        assert asked(found, "NormalForces", "initial values").result is Result.INCONCLUSIVE
        assert ending_of(each.result for each in found) is Ending.INCONCLUSIVE


@pytest.mark.parametrize("name", VIOLATIONS)
def test_a_planted_violation_is_named_and_no_other(name):
    found = judge(session_with(bent(name)(CANTOOLS)).evidence())
    subject, kind = VIOLATIONS[name]
    assert (subject, kind) in broken(found), [e for e in found if e.result is Result.FAILED]
    # An ECU that never recovers fails after the loss of all inputs too.
    others = broken(found) - {(subject, kind), ("return of all inputs", "recovery")}
    assert others == set()
    assert asked(found, subject, kind).evidence
    assert ending_of(each.result for each in found) is Ending.FAILED


@pytest.mark.parametrize("core", [PYTHON, C], ids=["python", "c"])
def test_our_own_ecu_conforms(core):
    compiler()
    cycle = core.ecu(load_calibration("l60"))

    class Ours:
        def receive(self, identifier, data, now_s):
            cycle.receive(Frame(identifier | EXTENDED, data), round(now_s * 1e9))

    found = judge(session_with(Ours(), frames_of=lambda now_ns: cycle.tick(now_ns).frames).evidence())
    assert broken(found) == set()


def test_a_bench_that_was_late_accuses_nobody_of_one_late_frame(good):
    table = good.evidence().table
    rows = [r for r, i in enumerate(table.can_id.tolist()) if i == loader_database().by_name["Limits"].can_id]
    without = table.select([r for r in range(len(table)) if r not in rows[100:102]])
    for bench, result in (
        (Bench(), Result.FAILED),
        (Bench(late_ns=15 * MS), Result.FAILED),  # the gap of 30 ms is 20 ms too long
        (Bench(late_ns=25 * MS), Result.INCONCLUSIVE),
        (Bench(shared_host=True), Result.INCONCLUSIVE),
    ):
        seen = Evidence.of(without, loader_database(), "EstimatorEcu", bench)
        assert asked(judge(seen), "Limits", "cycle time").result is result


@pytest.mark.parametrize(("slower", "result"), [(1.3, Result.INCONCLUSIVE), (2.0, Result.FAILED)])
def test_a_bench_that_is_always_late_still_finds_another_cycle_time(good, slower, result):
    """A starved computer delays frames, but twice the cycle time is another one."""
    table = good.evidence().table
    of_limits = table.can_id == loader_database().by_name["Limits"].can_id
    begin_ns = int(table.time_ns[of_limits][0])
    times = np.where(
        of_limits, begin_ns + (slower * (table.time_ns - begin_ns)).astype(np.int64), table.time_ns
    )
    seen = Evidence.of(
        replace(table, time_ns=times), loader_database(), "EstimatorEcu", Bench(late_share=0.2)
    )
    assert asked(judge(seen), "Limits", "cycle time").result is result


def test_a_node_on_the_same_computer_is_accused_of_what_no_computer_explains(good):
    table = good.evidence().table
    rows = [r for r, i in enumerate(table.can_id.tolist()) if i == loader_database().by_name["Limits"].can_id]
    without = table.select([r for r in range(len(table)) if r not in rows[100:115]])  # 160 ms
    seen = Evidence.of(without, loader_database(), "EstimatorEcu", Bench(shared_host=True))
    assert asked(judge(seen), "Limits", "cycle time").result is Result.FAILED


def test_frames_that_the_recorder_lost_accuse_no_counter(good):
    table = good.evidence().table
    rows = [r for r, i in enumerate(table.can_id.tolist()) if i == loader_database().by_name["Limits"].can_id]
    without = table.select([r for r in range(len(table)) if r not in rows[100:102]])
    seen = Evidence.of(without, loader_database(), "EstimatorEcu", Bench(dropped=2))
    assert asked(judge(seen), "Limits", "counter").result is Result.INCONCLUSIVE


def test_a_node_that_is_not_in_the_dbc_is_named_with_those_that_are():
    with pytest.raises(ConformError, match="there are EstimatorEcu, Machine"):
        Session(loader_database(), "Nobody", {}, start_ns=0)


def json_of(done):
    assert done.stdout, done.stderr
    cases = json.loads(done.stdout)["suites"][0]["cases"]
    return {case["question"]: case["result"] for case in cases}


def conform(bus, folder, *violations, interface="loaderhil", channel=None, node=None):
    """The command against an ECU that is switched on while it waits: exit code and verdicts.

    violations: of the foreign ECU of the tests; node: a context with another ECU.
    """
    program = Path(__file__).with_name("violations.py")
    node = node or running(program, interface, channel or bus.removeprefix("hub:"), DBC, *violations)
    words = ["conform", bus, "--lose", "BodyRates", "--steady-s", "1", "--out", str(folder), "--json"]
    with subprocess.Popen(
        [sys.executable, "-m", "loaderhil", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "COLUMNS": "200"},
    ) as bench:  # fmt: skip
        for line in bench.stderr:
            if "switch it on now" in line:
                break
        time.sleep(0.5)
        with node:
            out, err = bench.communicate(timeout=270)
    assert out, err
    cases = json.loads(out)["suites"][0]["cases"]
    return bench.returncode, {case["question"]: case["result"] for case in cases}


TEN = [name for name in VIOLATIONS if name not in ("starts late",)]


class TestOnTheHub:
    pytestmark = processes

    def test_the_example_conforms(self, hub, tmp_path):  # noqa: F811
        _, found = conform(f"hub:{hub}", tmp_path)
        # A busy machine leaves times open; it may not break anything.
        assert "FAILED" not in found.values(), found
        assert found["loss of BodyRates: state after loss"] == "PASSED"
        assert found["NormalForces: initial values"] == "PASSED"
        assert (tmp_path / "conform.html").read_text().startswith("<!doctype html>")
        again = loaderhil("conform", tmp_path, "--from-start", "--out", tmp_path / "again", "--json")
        assert json_of(again) == found

    @pytest.mark.parametrize("core", ["python", "c"])
    def test_our_own_ecu_conforms_as_a_process(self, core, hub, tmp_path):  # noqa: F811
        """Timing included: of what a busy computer explains a verdict is open, of nothing it is failed."""
        compiler()
        # built or compiled before it is waited for
        {"python": PYTHON, "c": C}[core].ecu(load_calibration("l60")).warm_up()
        node = running("-m", "loaderhil", "ecu", "--bus", f"hub:{hub}", "--core", core)
        _, found = conform(f"hub:{hub}", tmp_path, node=node)
        assert "FAILED" not in found.values(), found
        assert found["loss of BodyRates: state after loss"] == "PASSED"
        assert {"Limits: cycle time", "EstimatorEcu: start-up"} <= found.keys()

    def test_ten_planted_violations_are_each_named(self, hub, tmp_path):  # noqa: F811
        code, found = conform(f"hub:{hub}", tmp_path, *TEN[:8], TEN[9])
        assert code == Ending.FAILED
        for name in (*TEN[:8], TEN[9]):
            assert found["{}: {}".format(*VIOLATIONS[name])] == "FAILED", name
        # An ECU that ignores a loss never recovers from it, so the tenth has a run of its own.
        code, found = conform(f"hub:{hub}", tmp_path, "ignores a loss")
        assert found["loss of BodyRates: state after loss"] == "FAILED"

    def test_a_node_that_never_comes_ends_with_its_own_code(self, hub, tmp_path):  # noqa: F811
        done = loaderhil("conform", f"hub:{hub}", "--wait-s", 0.3, "--out", tmp_path)
        assert done.returncode == Ending.PEER_DIED
        assert "EstimatorEcu sent none of its messages" in done.stderr


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
@pytest.mark.timeout(600)
def test_the_example_conforms_on_vcan(tmp_path):
    _, found = conform(f"socketcan:{INTERFACE}", tmp_path, interface="socketcan", channel=INTERFACE)
    # A user-mode kernel is slow and drops frames, which counters and cycle times show; the content of frames does not depend on it.
    content = {
        name: said for name, said in found.items() if name.endswith((": presence", ": length", ": CRC"))
    }
    assert content
    assert set(content.values()) == {"PASSED"}, content
