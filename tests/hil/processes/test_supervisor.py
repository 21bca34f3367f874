"""Whatever happens to one process, the others end and the reason is known."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.processes.supervisor import Child, StartFailed, Supervisor

FAKE = str(Path(__file__).with_name("fake_child.py"))
ROOT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.processes


def start(supervisor: Supervisor, behaviour: str) -> Child:
    return supervisor.start(behaviour, [sys.executable, FAKE, behaviour], {"PYTHONPATH": str(ROOT)})


def running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"


def test_a_process_waits_for_go_then_reports_progress_waits_and_figures():
    heard = []
    with Supervisor(lambda name, event: heard.append((name, event["event"]))) as supervisor:
        child = start(supervisor, "work")
        supervisor.wait_ready([child], 20)
        assert heard == [("work", "ready")]
        supervisor.go(child)
        assert supervisor.wait_first_end(20) is child
        assert child.finished
        assert child.figures == {"ticks": 200}
        assert child.waits.tolist() == [5, 9, 3, 9, 14, 4]
    said = ["ready", "progress", "waited", "waited", "finished"]
    assert heard == [("work", event) for event in said]


def test_a_process_that_refuses_to_start_gives_its_reason_and_takes_the_others_along():
    with Supervisor() as supervisor:
        stays = start(supervisor, "stay")
        refuses = start(supervisor, "refuse")
        with pytest.raises(StartFailed, match=r"refuse process .* exit code 4: no bus at hub:/nowhere"):
            supervisor.wait_ready([stays, refuses], 20)
    assert not running(stays.process.pid)


def test_a_process_that_is_never_ready_is_named():
    with Supervisor() as supervisor:
        child = start(supervisor, "never-ready")
        with pytest.raises(StartFailed, match="never-ready"):
            supervisor.wait_ready([child], 0.5)
    assert not running(child.process.pid)


def test_a_killed_process_is_noticed_at_once_and_named_with_its_signal():
    with Supervisor() as supervisor:
        one, other = start(supervisor, "stay"), start(supervisor, "stay")
        supervisor.wait_ready([one, other], 20)
        one.process.send_signal(signal.SIGKILL)
        began = time.monotonic()
        assert supervisor.wait_first_end(20) is one
        assert time.monotonic() - began < 5
        assert one.how_it_ended().endswith("was killed by SIGKILL")
    assert not running(other.process.pid)


def test_a_process_that_ignores_sigterm_is_killed():
    with Supervisor() as supervisor:
        child = start(supervisor, "deaf")
        supervisor.wait_ready([child], 20)
        supervisor.stop(child, timeout_s=0.2)
        assert child.process.returncode == -signal.SIGKILL


def test_processes_do_not_outlive_a_supervisor_that_is_killed():
    script = (
        "import sys\n"
        "from hil.processes.supervisor import Supervisor\n"
        "s = Supervisor()\n"
        f"c = s.start('stay', [sys.executable, {FAKE!r}, 'stay'])\n"
        "s.wait_ready([c], 20)\n"
        "print(c.process.pid, flush=True)\n"
        "s.wait_first_end(60)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, env=environment
    ) as supervisor:
        assert supervisor.stdout is not None
        child = int(supervisor.stdout.readline())
        supervisor.kill()
    deadline = time.monotonic() + 10
    while running(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not running(child)


def test_a_process_that_a_fault_kills_is_gone_and_the_others_go_on():
    with Supervisor() as supervisor:
        victim, killer = start(supervisor, "stay"), start(supervisor, "strike kill stay")
        supervisor.wait_ready([victim, killer], 20)
        supervisor.go(killer)
        supervisor.wait_end(victim, 20)
        assert victim.process.returncode == -signal.SIGKILL
        assert supervisor.wait_first_end(0.2) is None  # its end is no news
        assert victim.how_it_ended().endswith("was killed by SIGKILL for an injected fault")


def test_a_restart_is_the_same_process_anew_and_only_where_none_runs():
    with Supervisor() as supervisor:
        victim, killer = start(supervisor, "stay"), start(supervisor, "strike restart,kill,restart stay")
        supervisor.wait_ready([victim, killer], 20)
        supervisor.go(killer)
        supervisor.wait_end(victim, 20)
        deadline = time.monotonic() + 20
        while len(supervisor.children) < 3 and time.monotonic() < deadline:
            supervisor.wait_first_end(
                0.05
            )  # the request to restart comes after the end of the victim, not with it
        (second,) = [c for c in supervisor.children if c.name == "stay" and c is not victim]
        supervisor.wait_ready([second], 20)
        assert running(second.process.pid)
    assert not running(second.process.pid)


def test_the_end_of_a_vital_process_is_news_whoever_killed_it():
    with Supervisor() as supervisor:
        command, environment = [sys.executable, FAKE, "stay"], {"PYTHONPATH": str(ROOT)}
        victim = supervisor.start("stay", command, environment, vital=True)
        killer = start(supervisor, "strike kill stay")
        supervisor.wait_ready([victim, killer], 20)
        supervisor.go(killer)
        assert supervisor.wait_first_end(20) is victim
