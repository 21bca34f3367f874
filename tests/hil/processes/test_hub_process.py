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
from bus.hub.client import HubTransport, hub_status, wait_for_hub
from bus.hub.status import HubStatus
from bus.socketcan.can_socket import kernel_has_can
from hil.ending import Ending
from hil.processes.hub import BitRates, ImpossibleRates, summary
from tests.bus.laws import collect
from tests.loaderhil.test_cli import loaderhil

WAIT_S = 200.0
"""The first start on a machine compiles plant and estimators."""


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "hub")


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """`loaderhil WORDS` until the end of the block."""
    command = [sys.executable, "-m", "loaderhil", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=WAIT_S)


@pytest.mark.processes
def test_a_running_hub_lists_its_clients(path: str) -> None:
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
    assert summary(status) == "10 frames in 4.0 s at 250000 bit/s, 25.0 % bus load"


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


def one_line(*words: str) -> str:
    """What a command that cannot have its bus says."""
    result = loaderhil(*words)
    assert result.returncode == Ending.HUB_LOST
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("loaderhil: ")
    return result.stderr


@pytest.mark.processes
@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("x" * 120, "bytes are too long for a socket's name, at most 107; use a shorter path"),
        ("missing/hub", "cannot be made there: No such file or directory; mkdir -p"),
        ("file", "in the way, and not a socket; remove it or use another path"),
    ],
)
def test_a_hub_that_cannot_serve_says_why_in_one_line(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "file").write_text("precious")
    assert says in one_line("hub", "--bus", f"hub:{tmp_path / name}")
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.processes
def test_a_second_hub_names_the_first_which_goes_on(path: str) -> None:
    with running("hub", "--bus", f"hub:{path}") as first:
        wait_for_hub(path, WAIT_S)
        assert f"a hub (process {first.pid}) already serves this address" in one_line(
            "hub", "--bus", f"hub:{path}"
        )
        HubTransport(path).close()


@pytest.mark.processes
def test_the_socket_of_a_killed_hub_is_in_nobodys_way(path: str) -> None:
    with running("hub", "--bus", f"hub:{path}") as killed:
        wait_for_hub(path, WAIT_S)
        killed.kill()
    assert Path(path).exists()
    assert "no hub listens there (it ended, or was killed)" in one_line(
        "hub", "--status", "--bus", f"hub:{path}"
    )
    with running("hub", "--bus", f"hub:{path}"):
        wait_for_hub(path, WAIT_S)
    assert not Path(path).exists()


@pytest.mark.processes
@pytest.mark.parametrize("command", [("ecu",), ("plant", "standstill")])
def test_a_bus_that_is_not_there_is_reported_before_anything_is_compiled(
    path: str, command: tuple[str, ...]
) -> None:
    says = one_line(*command, "--bus", f"hub:{path}")
    assert f"there is no hub; start one there first (loaderhil hub --bus hub:{path})" in says


@pytest.mark.processes
def test_plant_without_can_is_reported_what_is_missing() -> None:
    """Either this kernel has no CAN, or no such interface; both in one line with its remedy."""
    says = one_line("plant", "standstill", "--bus", "socketcan:nocan0")
    missing = "no such CAN interface" if kernel_has_can() else "this kernel has no CAN; load its modules"
    assert f"socketcan:nocan0: {missing}" in says


@pytest.mark.processes
def test_plant_ecu_and_hub_run_where_they_are_reported_to(path: str) -> None:
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
