"""Verification of expectations: each planted error does what it says, and what nobody looks at goes unnoticed."""

import json

import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Checker, Finding, Protector
from deploy.c.core import C
from ecu.core import PYTHON
from hil.compose import Choice
from hil.faults.table import KINDS
from hil.lockstep import EcuTick
from hil.verdict import Result
from testbench.verify.errors import ERRORS, BentEcu, EcuError, scaled
from testbench.verify.mutants import FAULTS, MutantError, mutants
from testbench.verify.verify import VerifyError, verify
from tests.conftest import STANDS
from tests.deploy.c.building import compiler

DATABASE = loader_database()


def frame_of(name, **values):
    codec = DATABASE.by_name[name]
    data = codec.encode_dict({signal: values.get(signal, 0) for signal in codec.signals})
    return Frame(codec.can_id, Protector(codec).protect(data) if codec.protection else data)


class Listening:
    """An ECU that keeps what it hears and sends what it is given."""

    def __init__(self, *frames):
        self.heard, self.frames, self.findings = [], frames, ()

    def receive(self, frame, now_ns):
        self.heard.append(frame)
        return ()

    def tick(self, now_ns) -> EcuTick:
        return self


def values_of(frame):
    codec = DATABASE.by_id[frame.can_id]
    if codec.protection is not None:
        assert Checker(codec).check(frame.data, 0) is Finding.INITIAL  # the CRC fits
    return codec.decode_dict(frame.data)


def test_an_exchanged_sign_keeps_the_size_and_the_crc():
    ecu = Listening()
    BentEcu(ecu, ERRORS["lateral sign"], DATABASE).receive(
        frame_of("BodyAcceleration", Lateral=1.5, Vertical=9.81), 0
    )
    heard = values_of(ecu.heard[0])
    assert heard["Lateral"] == pytest.approx(-1.5)
    assert heard["Vertical"] == pytest.approx(9.81, abs=1e-3)


def test_a_scaled_signal_with_an_offset_is_scaled_in_its_unit():
    error = EcuError("", sent={"NormalForces.FrontLeft": scaled(1.2)})
    (sent,) = BentEcu(Listening(frame_of("NormalForces", FrontLeft=30.0)), error, DATABASE).tick(0).frames
    assert values_of(sent)["FrontLeft"] == pytest.approx(36.0, abs=0.02)


def test_deaf_mute_and_late_errors_do_what_they_say():
    ecu = Listening(frame_of("Limits", Speed=50), frame_of("EcuStatus", State=1))
    deaf = BentEcu(ecu, ERRORS["deaf to the arm"], DATABASE)
    deaf.receive(frame_of("LinkageAngles"), 0)
    deaf.receive(frame_of("BodyRates"), 0)
    assert [DATABASE.by_id[f.can_id].name for f in ecu.heard] == ["BodyRates"]
    mute = BentEcu(ecu, ERRORS["limits mute"], DATABASE)
    assert [DATABASE.by_id[f.can_id].name for f in mute.tick(0).frames] == ["EcuStatus"]
    late = BentEcu(ecu, ERRORS["200 ms late"], DATABASE)
    assert [len(late.tick(0).frames) for _ in range(21)] == [0] * 20 + [2]


@pytest.mark.parametrize("name", ERRORS)
def test_every_planted_error_changes_something(name):
    error = ERRORS[name]
    sending = [
        frame_of(codec.name, **_plain(codec))
        for codec in DATABASE.by_name.values()
        if "EstimatorEcu" in codec.senders
    ]
    hearing = [
        frame_of(codec.name, **_plain(codec))
        for codec in DATABASE.by_name.values()
        if "Machine" in codec.senders
    ]
    ecu = Listening(*sending)
    bent = BentEcu(ecu, error, DATABASE)
    for frame in hearing:
        bent.receive(frame, 0)
    assert ecu.heard != hearing or bent.tick(0).frames != sending


def _plain(codec):
    """Values that no error leaves as they are: a third of each range, and states that no error sends."""
    plain = {}
    for signal in codec.layout:
        low, high = sorted(raw * signal.scale + signal.offset for raw in signal.raw_limits)
        plain[signal.name] = low + (high - low) / 3
        if signal.choices:
            raw = 3 if 3 in signal.choices else max(signal.choices)
            plain[signal.name] = raw * signal.scale + signal.offset
        elif signal.length == 1:
            plain[signal.name] = 1
    return plain


def test_every_fault_class_of_the_bench_is_among_the_mutants():
    assert {fault["kind"] for fault in FAULTS} == set(KINDS)


def test_a_pattern_of_nothing_names_what_there_is():
    with pytest.raises(MutantError, match="there are drop BodyRates"):
        mutants(["nothing"], [], 1.0)
    assert {m.kind for m in mutants(["ECU error"], [], 1.0)} == {"ECU error"}
    (effect,) = mutants(["gyro_bias"], ["gyro_bias"], 1.0)
    assert effect.changes == ("machine.effects.gyro_bias={}",)


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    """A scenario of one second, and expectations about its state."""
    folder = tmp_path_factory.mktemp("verify")
    (folder / "short.toml").write_text(STANDS.format(duration_s=1.0))
    (folder / "state.toml").write_text('[[expect]]\nkind = "state"\nis = "running"\nfrom_s = 0.3\n')
    (folder / "nothing.toml").write_text('[[expect]]\nkind = "no_roll_over"\n')
    (folder / "wrong.toml").write_text('[[expect]]\nkind = "state"\nis = "fault"\n')
    return folder


def outcomes(folder, tests, *only, core=PYTHON):
    choice = Choice(scenario=str(folder / "short.toml"), expect=folder / tests, core=core)
    chosen = mutants(only, [], 0.8)
    return {each.mutant.name: each for each in verify(choice, chosen, lambda *_: None)}


ONLY = ("drop BodyRates", "always running", "never running", "status mute")


@pytest.mark.timeout(600)
@pytest.mark.parametrize("core", [PYTHON, C], ids=["python", "c"])
def test_each_mutant_is_noticed_open_or_not(standing, core):
    compiler()
    found = outcomes(standing, "state.toml", *ONLY, core=core)
    assert {name: each.result for name, each in found.items()} == {
        "drop BodyRates": Result.PASSED,
        "always running": Result.FAILED,  # it is running in any case, and nobody can see the difference
        "never running": Result.PASSED,
        "status mute": Result.INCONCLUSIVE,
    }
    assert "EcuStatus.State is running" in found["never running"].noticed[0]


@pytest.mark.timeout(600)
def test_an_expectation_of_nothing_notices_nothing(standing):
    found = outcomes(standing, "nothing.toml", "never running")
    assert {each.result for each in found.values()} == {Result.FAILED}


@pytest.mark.timeout(600)
def test_tests_that_fail_by_themselves_are_not_verified(standing):
    with pytest.raises(VerifyError, match="fails without any mutant"):
        outcomes(standing, "wrong.toml", "never running")
    with pytest.raises(VerifyError, match="has no"):
        list(verify(Choice(scenario=str(standing / "short.toml")), [], lambda *_: None))


@pytest.mark.timeout(600)
def test_the_command_lists_and_permits(standing, capsys):
    from loaderhil.cli import app

    words = ["verify", str(standing / "state.toml"), "--scenario", str(standing / "short.toml"), "--json"]
    words += ["--only", "always running", "--only", "never running", "--out", str(standing / "v.html")]
    for permit, code in ((0, 1), (1, 0)):
        with pytest.raises(SystemExit) as ended:
            app([*words, "--permit", str(permit)])
        assert ended.value.code == code
        cases = json.loads(capsys.readouterr().out)["suites"][0]["cases"]
        assert [case["result"] for case in cases] == ["FAILED", "PASSED"]
    assert "Nobody noticed" in (standing / "v.html").read_text()
