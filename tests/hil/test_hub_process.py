"""The hub as a user meets it: started, asked, and every way in which it cannot be had."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from bus.frame import BRS, FD, Frame
from bus.hub_client import HubTransport, hub_status, wait_for_hub
from bus.hub_status import HubStatus
from hil.ending import Ending
from hil.processes.hub import BitRates, ImpossibleRates, summary
from tests.bus.laws import collect
from tests.hil.test_cli import loaderhil

WAIT_S = 200.0
"""The first start on a machine compiles plant and estimators."""


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "hub")


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """`loaderhil WORDS` until the end of the block."""
    command = [sys.executable, "-m", "hil", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=WAIT_S)


@pytest.mark.processes
def test_a_running_hub_tells_who_is_on_it(path: str) -> None:
    with running("hub", "--bus", f"hub:{path}", "--bit-rate", "500000"):
        wait_for_hub(path, WAIT_S)
        with HubTransport(path, name="one [bold]") as one, HubTransport(path, name="other") as other:
            one.send(Frame(1, bytes(8)))
            collect(other, 1)
            result = loaderhil("hub", "--bus", f"hub:{path}", "--status")
    assert result.returncode == Ending.PASSED, result.stderr
    first, heading, *clients = result.stdout.splitlines()
    assert first.startswith("1 frames in ")
    assert " s at 500000 bit/s, " in first
    assert heading.split() == [
        "client",
        "process",
        "sent",
        "delivered",
        "dropped",
        "backlog",
        "waiting",
        "malformed",
    ]
    assert [line.split()[-7:] for line in clients] == [
        [str(os.getpid()), "1", "0", "0", "0", "0", "0"],
        [str(os.getpid()), "0", "1", "0", "0", "0", "0"],
    ]
    assert clients[0].startswith("one [bold]")


def test_the_load_is_the_share_of_time_that_the_wire_was_busy() -> None:
    status = HubStatus(frames=10, uptime_s=4.0, bit_rate=250_000, busy_s=1.0, clients=())
    assert summary(status) == "10 frames in 4.0 s at 250000 bit/s, 25.0 % of the wire's time"


@pytest.mark.processes
def test_the_data_bit_rate_shortens_frames_that_switch(path: str) -> None:
    """64 data bytes at 20 kbit/s take more than 26 ms; at 20 Mbit/s the wire is free again much sooner."""
    frame = Frame(1, bytes(64), 0, FD | BRS)
    busy_s = []
    for options in ((), ("--data-bit-rate", "20000000")):
        with running("hub", "--bus", f"hub:{path}", "--bit-rate", "20000", *options):
            wait_for_hub(path, WAIT_S)
            with HubTransport(path) as one, HubTransport(path) as other:
                one.send(frame)
                collect(other, 1)
            busy_s.append(hub_status(path).busy_s)
    assert busy_s[0] > 512 / 20_000
    assert busy_s[1] < busy_s[0] - 500 / 20_000


@pytest.mark.parametrize(
    ("nominal", "data", "says"),
    [
        (None, 2_000_000, "--data-bit-rate 2000000 needs --bit-rate too"),
        (500_000, 250_000, "--data-bit-rate 250000 is below --bit-rate 500000 bit/s"),
    ],
)
def test_bit_rates_that_no_bus_has_are_refused(nominal: int | None, data: int, says: str) -> None:
    with pytest.raises(ImpossibleRates, match=says):
        BitRates(nominal, data)


@pytest.mark.processes
def test_plant_ecu_and_hub_run_where_they_are_told_to(path: str) -> None:
    """The kernel says where each may run, once all are on the bus; their options are parsed and applied."""
    cpu = min(os.sched_getaffinity(0))
    options = ("--bus", f"hub:{path}", "--cpu", str(cpu))
    with ExitStack() as stack:
        hub = stack.enter_context(running("hub", *options))
        wait_for_hub(path, WAIT_S)
        stack.enter_context(running("ecu", *options))
        stack.enter_context(running("plant", "standstill", *options))
        deadline = time.monotonic() + WAIT_S
        while len(clients := hub_status(path).clients) < 2:
            assert time.monotonic() < deadline, "plant and ecu did not join"
            time.sleep(0.05)
        assert {client.name for client in clients} == {"plant", "ecu"}
        for pid in (hub.pid, *(client.pid for client in clients)):
            assert os.sched_getaffinity(pid) == {cpu}
