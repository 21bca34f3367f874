"""The link to systemd: what is sent, how often, and that nothing of it can stop the service."""

import os
import signal
import socket
import subprocess
import sys

import pytest

from hil.shell.service_manager import PINGS_PER_TIMEOUT, ServiceManager


@pytest.fixture
def systemd(tmp_path):
    """A socket in systemd's place: its path, and what came."""
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(path))
        link.settimeout(60.0)
        yield str(path), link


def received(link):
    """Everything that waits in the socket."""
    link.setblocking(False)
    found = []
    try:
        while True:
            found.append(link.recv(4096).decode())
    except BlockingIOError:
        return found


def test_pings_come_at_a_quarter_of_the_timeout(systemd):
    path, link = systemd
    manager = ServiceManager.from_environment({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "400000"})
    tick_ns = 10_000_000
    for tick in range(100):  # one second of ticks
        manager.alive(tick * tick_ns)
    manager.close()
    assert received(link) == ["WATCHDOG=1"] * round(1.0 / 0.4 * PINGS_PER_TIMEOUT)


@pytest.mark.parametrize(
    "environment",
    [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"}],
)
def test_without_a_watchdog_nothing_is_pinged(systemd, environment):
    path, link = systemd
    manager = ServiceManager.from_environment({"NOTIFY_SOCKET": path, **environment})
    manager.ready("up")
    manager.alive(0)
    manager.stopping()
    manager.close()
    assert received(link) == ["READY=1\nSTATUS=up", "STOPPING=1"]


def test_a_missing_or_full_socket_stops_nothing(tmp_path, systemd):
    missing = ServiceManager(str(tmp_path / "none"), 1.0)
    missing.ready("up")
    missing.close()
    full = ServiceManager(systemd[0], 1.0)
    for _ in range(10_000):  # far more than a socket's queue takes
        full.stopping()
    full.close()


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_the_ecu_pings_while_it_ticks_and_not_while_it_hangs(systemd, tmp_path):
    path, link = systemd
    hub = subprocess.Popen([sys.executable, "-m", "loaderhil", "hub", "--bus", f"hub:{tmp_path / 'hub'}"])
    ecu = None
    try:
        _wait_for(tmp_path / "hub")
        ecu = subprocess.Popen(
            [sys.executable, "-m", "loaderhil", "ecu", "--bus", f"hub:{tmp_path / 'hub'}"],
            env={**os.environ, "NOTIFY_SOCKET": path, "WATCHDOG_USEC": "2000000"},
        )
        link.settimeout(200.0)  # it may have to compile
        assert link.recv(4096).decode().startswith("READY=1\nSTATUS=estimating on hub:")
        assert [link.recv(4096) for _ in range(3)] == [b"WATCHDOG=1"] * 3
        ecu.send_signal(signal.SIGSTOP)
        received(link)
        link.settimeout(2.0)
        with pytest.raises(TimeoutError):  # the whole timeout of the watchdog passes without a ping
            link.recv(4096)
        ecu.send_signal(signal.SIGCONT)
        link.settimeout(60.0)
        assert link.recv(4096) == b"WATCHDOG=1"
        ecu.terminate()
        while (last := link.recv(4096)) == b"WATCHDOG=1":
            pass
        assert last == b"STOPPING=1"
        assert ecu.wait(60.0) == 130
    finally:
        for process in (ecu, hub):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
                process.wait(60.0)


def _wait_for(path, patience_s=60.0):
    import time

    end = time.monotonic() + patience_s
    while not path.exists():
        assert time.monotonic() < end, f"{path} did not come"
        time.sleep(0.05)
