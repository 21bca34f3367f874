"""A soak in real time: its scenario is sound, and what a run left is read as it happened."""

import random
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbc import loader_database
from dbc.protection import Protector
from dbc.recordings.logfile import read_candump
from dbc.recordings.writer import CandumpWriter
from hil.ending import Ending
from hil.faults.record import Injected
from hil.faults.table import faults_of
from hil.timing.vitals import Life
from hil.verdict import Result
from plant.unit.scenario import load_scenario
from studies.soak import detections as evidence
from studies.soak.document import page
from studies.soak.realtime import attribute, judge, permitted, soak_realtime, written
from studies.soak.soak import Soak
from studies.soak.watch import Detection, Mechanism, Witness
from tests.hil.faults.traffic import DATABASE, MS, fault, frames, injector, passed

LOG = """\
2026-11-21 08:00:00,001 ecu.node WARNING Stale(group='rates', at_ns=5000000)
2026-11-21 08:00:00,002 ecu.node WARNING StateChanged(before=<State.RUNNING: 1>, after=<State.DEGRADED: 2>, event=<Event.INPUTS_BAD: 'x'>, at_ns=6000000)
2026-11-21 08:00:00,003 ecu.node WARNING ProtectionFailed(message='BodyRates', what=<Finding.WRONG_CRC: 'wrong CRC'>, at_ns=7000000)
2026-11-21 08:00:00,004 ecu.node WARNING Implausible(message='Articulation', signal='ArticulationAngle', value=1.0, reason='moved', at_ns=8000000)
2026-11-21 08:00:00,005 hil WARNING something else
"""


def logged(tmp_path, arrived):
    file = tmp_path / "bus.log"
    with CandumpWriter(file) as writer:
        for at_ns, frame in arrived:
            writer.write(frame._replace(at_ns=at_ns), "loader")
    return read_candump(file)


def test_the_scenario_of_a_soak_is_sound_and_the_plant_survives_it(tmp_path):
    file = tmp_path / "soak.toml"
    file.write_text(written(random.Random(3), 600.0, 3))
    assert load_scenario(file).duration_s == 600.0
    faults = faults_of(file, loader_database())
    assert len(faults) > 50
    assert not any(f.label == "kill process=plant" for f in faults)
    assert permitted({"kind": "kill", "process": "ecu"})
    assert not permitted({"kind": "kill", "process": "plant"})


def test_the_ecus_log_is_read_back(tmp_path):
    (tmp_path / "ecu.log").write_text(LOG)
    detections = evidence.of_ecu(tmp_path)
    assert [(n.at_ns // MS, n.mechanism) for n in detections] == [
        (5, Mechanism.TIMEOUT),
        (7, Mechanism.CRC),
        (8, Mechanism.PLAUSIBILITY),
    ]
    assert [sorted(evidence.messages_of(n)) for n in detections] == [
        ["BodyRates"],
        ["BodyRates"],
        ["Articulation"],
    ]


def test_the_line_is_the_one_that_the_ecu_writes(tmp_path, caplog):
    """The findings themselves, as the node logs them."""
    from dbc.protection import Finding as Check
    from ecu.findings import Implausible, ProtectionFailed, Stale
    from ecu.node import log_finding

    for finding in (
        Stale("pressures", 1),
        ProtectionFailed("BodyRates", Check.REPEATED, 2),
        Implausible("X", "Y", 1.0, "far", 3),
    ):
        log_finding(finding)
    (tmp_path / "ecu.log").write_text("\n".join(caplog.messages))
    assert [n.mechanism for n in evidence.of_ecu(tmp_path)] == [
        Mechanism.TIMEOUT,
        Mechanism.COUNTER,
        Mechanism.PLAUSIBILITY,
    ]
    assert evidence.messages_of(evidence.of_ecu(tmp_path)[0]) == {"LiftPressure", "TiltPressure"}


@pytest.mark.parametrize(
    ("table", "mechanism"),
    [
        ({"kind": "drop", "for_s": 0.2}, Mechanism.TIMEOUT),
        ({"kind": "corrupt"}, Mechanism.CRC),
        ({"kind": "repeat"}, Mechanism.COUNTER),
    ],
)
def test_what_the_machine_must_have_found_follows_from_its_bus(tmp_path, table, mechanism):
    arrived = passed(injector({"message": "Limits", "at_s": 0.1, **table}), frames("Limits", 50), side="ecu")
    detections = evidence.of_machine(logged(tmp_path, arrived), 50 * MS)
    assert mechanism in {n.mechanism for n in detections}
    assert all(n.at_ns >= 100 * MS for n in detections)
    assert {n.who for n in detections} == {Witness.MACHINE}


def test_a_sound_bus_is_silent_and_a_babbler_is_not(tmp_path):
    sound = logged(tmp_path, [(n * 10 * MS, f) for n, f in enumerate(frames("Limits", 50))])
    assert evidence.of_machine(sound, 50 * MS) == evidence.of_bench(sound) == []
    assert evidence.untimely(sound) == []
    babble = logged(tmp_path, passed(injector({"kind": "babble", "for_s": 0.01, "interval_us": 1000.0}), []))
    assert len(evidence.of_bench(babble)) == 10


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"kind": "drop", "for_s": 0.05}, ["Limits late"]),
        ({"kind": "repeat", "for_s": 0.01, "gap_ms": 2.0}, ["Limits early"]),
        ({"kind": "delay", "delay_ms": 6.0, "for_s": 0.2}, ["Limits late", "Limits early"]),
    ],
)
def test_late_and_early_messages_are_reported_at_their_time(tmp_path, table, expected):
    arrived = passed(injector({"message": "Limits", "at_s": 0.1, **table}), frames("Limits", 50), side="ecu")
    detections = evidence.untimely(logged(tmp_path, arrived))
    assert [n.what for n in detections] == expected
    assert all(95 * MS <= n.at_ns <= 330 * MS for n in detections)
    assert {(n.who, n.mechanism) for n in detections} == {(Witness.BENCH, Mechanism.DEADLINE)}


def test_answers_are_states_with_the_limits_sent_beside_them(tmp_path):
    status, limits = DATABASE.by_name["EcuStatus"], DATABASE.by_name["Limits"]
    sign = {c.name: Protector(c) for c in (status, limits)}
    arrived = []
    for n in range(20):
        values = dict.fromkeys(limits.signals, 0) | {"Speed": float(n)}
        arrived.append(
            (
                n * 10 * MS,
                frames("Limits", 1)[0]._replace(data=sign["Limits"].protect(limits.encode_dict(values))),
            )
        )
        values = dict.fromkeys(status.signals, 0) | {"State": n % 2 + 1}
        arrived.append(
            (
                n * 10 * MS + MS,
                frames("EcuStatus", 1)[0]._replace(
                    data=sign["EcuStatus"].protect(status.encode_dict(values))
                ),
            )
        )
    answers = evidence.answers_of(logged(tmp_path, arrived))
    assert [a.state for a in answers] == [n % 2 + 1 for n in range(20)]
    assert [a.limits["Speed"] for a in answers] == list(range(20))
    assert np.all(np.diff([a.at_ns for a in answers]) == 10 * MS)


def test_detections_go_to_the_fault_of_their_time_and_message():
    found = Soak(0, simulated_s=30.0)
    faults = [
        fault(kind="drop", message="BodyRates", at_s=5.0, for_s=1.0),
        fault(kind="drop", message="Limits", at_s=10.0, for_s=1.0),
    ]
    was = {1: Injected(1, "a", 5.0, 6.0, 7), 2: Injected(2, "b", 10.0, 11.0, 0)}
    detections = [
        Detection(5_100 * MS, Witness.ECU, Mechanism.COUNTER, "message='BodyRates', what"),
        Detection(5_200 * MS, Witness.ECU, Mechanism.TIMEOUT, "group='slope'"),  # a starved host
        Detection(8_000 * MS, Witness.ECU, Mechanism.CRC, "message='BodyRates', what"),
        Detection(1_000 * MS, Witness.ECU, Mechanism.TIMEOUT, "group='slope'"),  # starting up
    ]
    late = [
        Detection(at_ms * MS, Witness.BENCH, Mechanism.DEADLINE, "BodyRates late")
        for at_ms in (5_300, 8_000, 10_500)
    ]
    attribute(found, detections, 0, was, faults, late)
    assert [(h.struck, h.detected) for h in found.faults] == [
        (True, {(Witness.ECU, Mechanism.COUNTER), (Witness.BENCH, Mechanism.DEADLINE)}),
        (False, frozenset()),  # of another message
    ]
    assert found.unexplained.lines == ["8.00 s: ECU, CRC: message='BodyRates', what"]
    assert found.result is Result.FAILED
    found.doubt = "ecu waited 9 % of the time"
    assert found.result is Result.INCONCLUSIVE


@pytest.mark.parametrize(
    ("detection", "node", "needed_ms"),
    [
        # after 3 cycles of 10 ms, and after 50 ms
        (Detection(1_000 * MS, Witness.ECU, Mechanism.TIMEOUT, "group='rates'"), "Machine", 20),
        (Detection(1_000 * MS, Witness.MACHINE, Mechanism.TIMEOUT, "Limits stale"), "EstimatorEcu", 40),
    ],
)
def test_a_missed_message_is_the_hosts_by_one_wait_as_long_as_it_may_be_late(detection, node, needed_ms):
    """A cycle goes by before it is late at all; the other node's waits, another time and another finding count for nothing."""

    def excused(waited_ms, *, at_ms=1_030, of=node, what=detection):
        looks = np.array([(at_ms - 85, at_ms, waited_ms)], np.int64) * MS
        return evidence.by_a_wait(what, {of: {"hub": looks}}, 50 * MS)

    assert excused(needed_ms)
    assert not excused(needed_ms - 1)
    assert not excused(needed_ms, at_ms=960)
    assert not excused(needed_ms, at_ms=1_200)
    assert not excused(needed_ms, of={"Machine": "EstimatorEcu"}.get(node, "Machine"))
    assert not excused(needed_ms, what=replace(detection, mechanism=Mechanism.COUNTER))


def test_what_a_wait_explains_is_still_detected_of_a_fault_and_unexplained_no_more():
    faults = [fault(kind="drop", message="BodyRates", at_s=5.0, for_s=1.0)]
    detections = [
        Detection(at_ms * MS, Witness.ECU, Mechanism.TIMEOUT, "group='rates'")
        for at_ms in (5_100, 8_000, 9_000)
    ]
    found = Soak(0, simulated_s=30.0)
    was = {1: Injected(1, "a", 5.0, 6.0, 7)}
    attribute(found, detections, 0, was, faults, waited=lambda n: n.at_ns != 9_000 * MS)
    assert found.faults[0].detected == {(Witness.ECU, Mechanism.TIMEOUT)}
    assert [line[:6] for line in found.unexplained.lines] == ["9.00 s"]


def test_a_run_that_never_began_is_a_failure_and_not_a_crash(tmp_path):
    for name in ("bus.log", "ecu-bus.log", "ecu.log"):
        (tmp_path / name).write_text("")
    found = Soak(0)
    judge(found, tmp_path, [], 0.05)
    assert found.violations.lines == ["the machine sent no sample"]
    assert found.result is Result.FAILED


@pytest.mark.processes
def test_a_short_soak_in_real_time(tmp_path):
    """Seven seconds as processes: nobody dies, and the ECU keeps its word; the host may be too busy to say more."""
    found = soak_realtime(7.0, 4, tmp_path)
    assert found.violations.lines == []
    assert found.faults
    assert found.states["running"] > 100
    assert found.result is not Result.FAILED, found.unexplained.lines


@pytest.mark.parametrize(
    ("ending", "result"), [(Ending.FAILED, Result.INCONCLUSIVE), (Ending.PEER_DIED, Result.FAILED)]
)
def test_a_run_that_took_too_long_on_a_starved_host_decides_nothing_and_a_dead_process_does(
    tmp_path, monkeypatch, ending, result
):
    record = SimpleNamespace(duration_s=8.0, vitals=None)
    module = "studies.soak.realtime"
    monkeypatch.setattr(
        f"{module}.run_realtime", lambda *_: SimpleNamespace(ending=ending, reason="why", record=record)
    )

    def judged(found, *_):
        found.doubt = "plant waited 27 % of the time"

    monkeypatch.setattr(f"{module}.judge", judged)
    assert soak_realtime(10.0, 4, tmp_path).result is result


@pytest.mark.parametrize(
    ("grown_kib", "seconds", "result"),
    [(1000, 600, Result.PASSED), (1100, 600, Result.FAILED), (0, 100, Result.INCONCLUSIVE)],
)
def test_a_process_that_grows_fails_the_soak_and_one_seen_too_briefly_leaves_it_open(
    grown_kib, seconds, result
):
    settled = 60 << 20
    life = Life(
        process="ecu", pid=1, seconds=seconds, start_bytes=50 << 20, settled_bytes=settled, waited=0.0,
        end_bytes=settled, largest_bytes=settled + grown_kib * 1024, worst_waited=0.0,
    )  # fmt: skip
    found = Soak(4, simulated_s=600.0, lives=(life,))
    assert found.result is result
    text = page(found, "loaderhil soak")
    assert "## Memory" in text
    assert f"**{result.value}** memory of every process flat" in text
    assert (f"| ecu | 600 | 50.0 | 60.0 | 60.0 | {grown_kib} |" in text) == (seconds == 600)
    assert "## Memory" not in page(Soak(4, simulated_s=600.0), "loaderhil soak")
