"""Real-time options: the kernel itself says what was granted, in a process of its own; refusals are one line."""

import gc
import multiprocessing
import os
import resource
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.ending import Ending
from hil.shell.realtime_options import RealtimeOptions, RealtimeRefused
from loaderhil.cli import app
from tests.hil.processes.test_realtime import started, wait_until_running
from tests.loaderhil.test_cli import loaderhil

NOBODY = 65534
WAIT_S = 60.0


def apart(work: Callable[[], object]) -> object:
    """What `work` returns, or the text of its refusal, from a process of its own: nothing is left to this one."""

    def body() -> None:
        try:
            theirs.send(work())
        except RealtimeRefused as refused:
            theirs.send(str(refused))

    ours, theirs = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=body)
    process.start()
    assert ours.poll(WAIT_S)
    result = ours.recv()
    process.join(WAIT_S)
    assert process.exitcode == 0
    return result


def give_up_privileges() -> None:
    """Be a user to whom the kernel grants no real time and 64 KiB of locked memory."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
    if os.geteuid() == 0:
        os.setresuid(NOBODY, NOBODY, NOBODY)


def granted(options: RealtimeOptions) -> bool:
    """Whether this machine grants it."""
    return apart(options.apply) is None


def test_one_processor_is_kept_to() -> None:
    cpu = max(os.sched_getaffinity(0))

    def work() -> set[int]:
        RealtimeOptions(cpu=cpu).apply()
        return os.sched_getaffinity(0)

    assert apart(work) == {cpu}


@pytest.mark.parametrize("freeze", [True, False])
def test_what_is_loaded_is_frozen_on_demand(freeze: bool) -> None:
    def work() -> int:
        gc.unfreeze()
        RealtimeOptions(gc_freeze=freeze).apply()
        return gc.get_freeze_count()

    count = apart(work)
    assert isinstance(count, int)
    assert (count > 1000) is freeze


def test_the_priority_is_the_kernels() -> None:
    if not granted(RealtimeOptions(fifo=1)):
        pytest.skip("this user gets no real-time priority")

    def work() -> tuple[int, int]:
        RealtimeOptions(fifo=7).apply()
        return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority

    assert apart(work) == (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 7)


def test_all_memory_is_locked() -> None:
    if not granted(RealtimeOptions(lock_memory=True)):
        pytest.skip("this user may not lock that much memory")

    def work() -> int:
        RealtimeOptions(lock_memory=True).apply()
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmLck:"))

    locked_kib = apart(work)
    assert isinstance(locked_kib, int)
    assert locked_kib > 10_000  # Python and what the tests have loaded


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (RealtimeOptions(fifo=50), "--fifo 50: this user's highest real-time priority is 0; raise the limit"),
        (RealtimeOptions(lock_memory=True), "--lock-memory: this user may lock 64 KiB, and the process is"),
    ],
)
def test_a_user_without_the_right_is_reported_which_limit_to_raise(
    options: RealtimeOptions, says: str
) -> None:
    def work() -> None:
        give_up_privileges()
        options.apply()

    refusal = apart(work)
    assert isinstance(refusal, str)
    assert refusal.startswith(says)
    assert "or leave" in refusal
    assert "\n" not in refusal


def test_a_limit_that_suffices_is_not_blamed(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a container without real time even root is refused."""

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (99, 99))
    with pytest.raises(RealtimeRefused, match="container or a control group without real-time"):
        RealtimeOptions(fifo=50, gc_freeze=False).apply()


def test_a_processor_that_is_not_there_is_refused_with_those_that_are() -> None:
    allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
    refusal = apart(RealtimeOptions(cpu=1023).apply)
    assert isinstance(refusal, str)
    assert refusal.startswith("--cpu 1023: this process may not run there")
    assert f"it may on {allowed}: the machine has {os.cpu_count()} processors" in refusal


def test_the_command_line_says_it_in_one_line(tmp_path: Path) -> None:
    result = loaderhil("hub", "--bus", f"hub:{tmp_path / 'hub'}", "--cpu", "1023")
    assert result.returncode == Ending.MISUSED
    assert result.stderr.startswith("loaderhil: --cpu 1023: this process may not run there")
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "hub").exists()


@pytest.mark.parametrize("command", ["plant loaded", "hub"])
def test_the_words_for_a_process_say_the_same_to_it(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """What the command line understands of them is what they were made of; the hub goes before the others."""
    options = RealtimeOptions(fifo=50, lock_memory=True, cpu=1, gc_freeze=False)
    understood: list[RealtimeOptions] = []
    module = f"hil.processes.{command.split()[0]}"
    monkeypatch.setattr(
        f"{module}.run", lambda *arguments, **_: understood.append(arguments[-1]) or Ending.PASSED
    )
    result = CliRunner().invoke(app, [*command.split(), *options.words(above=3)])
    assert result.exit_code == Ending.PASSED, result.output
    assert understood == [replace(options, fifo=53)]
    assert RealtimeOptions(fifo=98).words(above=3) == ["--fifo", "99"]
    assert RealtimeOptions().words() == []


def test_in_lockstep_they_are_a_mistake() -> None:
    result = loaderhil("run", "standstill", "--fifo", "50")
    assert result.returncode == Ending.MISUSED
    assert "--fifo" in result.stderr
    assert "add --realtime" in " ".join(result.stderr.replace("│", " ").split())


@pytest.mark.processes
@pytest.mark.timeout(240)
def test_a_run_passes_them_on_to_all_but_its_recorder(
    scenario: Callable[[float], Path], tmp_path: Path
) -> None:
    out, cpu = tmp_path / "run", min(os.sched_getaffinity(0))
    with started("run", scenario(3.0), "--realtime", "--cpu", cpu, "--out", out) as process:
        running = wait_until_running(process, out)
        keeps = {name: os.sched_getaffinity(pid) for name, pid in running.items()}
        process.communicate(timeout=60)
    assert keeps.pop("record") == os.sched_getaffinity(0)
    assert keeps == {"hub": {cpu}, "ecu": {cpu}, "plant": {cpu}}
