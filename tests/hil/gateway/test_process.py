"""`loaderhil gateway` as a process between two hubs: it passes frames, and ends in one clear line."""

import os
import select
import signal
import subprocess
import sys
from contextlib import ExitStack, closing
from threading import Thread

import pytest

from bus.address import open_transport
from bus.frame import Frame
from bus.hub.client import hub_status
from bus.hub.server import Hub
from dbc import loader_database
from hil.ending import Ending
from hil.faults.control import Refused, ask
from tests.bus.laws import WAIT_S

pytestmark = [pytest.mark.processes, pytest.mark.timeout(240)]
SENSOR = loader_database().by_name["Articulation"].can_id
SPEEDS = loader_database().by_name["WheelSpeedsFront"].can_id


class RunningHub:
    """A hub that relays in a thread of its own until it is closed."""

    def __init__(self, path):
        self.path = str(path)
        self._hub = Hub(self.path)
        self._thread = Thread(target=self._hub.run)
        self._thread.start()

    def close(self):
        if self._thread.is_alive():
            self._hub.stop()
        self._thread.join()
        self._hub.close()


@pytest.fixture
def hubs(tmp_path):
    with ExitStack() as stack:
        yield {side: stack.enter_context(closing(RunningHub(tmp_path / side))) for side in ("plant", "ecu")}


@pytest.fixture
def control(tmp_path):
    return tmp_path / "control"


@pytest.fixture
def gateway(hubs, control):
    """The process, once it is a client of both hubs."""
    with subprocess.Popen(
        [sys.executable, "-m", "loaderhil", "gateway", "--control", str(control)]
        + [word for side, hub in hubs.items() for word in (f"--{side}-bus", f"hub:{hub.path}")],
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            while any(not hub_status(hub.path).clients for hub in hubs.values()):
                assert process.poll() is None, process.communicate()
            yield process
        finally:
            process.kill()


def test_frames_cross_and_ctrl_c_ends_it_quietly(hubs, gateway):
    with (
        open_transport(f"hub:{hubs['plant'].path}") as machine,
        open_transport(f"hub:{hubs['ecu'].path}") as controller,
    ):
        for n in range(500):
            # no CRC fits: passed on all the same, and reported
            machine.send(Frame(SENSOR, n.to_bytes(8, "big")))
        heard = []
        while len(heard) < 500:
            assert select.select([controller.fileno()], [], [], WAIT_S)[0]
            heard += controller.drain()
    assert [int.from_bytes(frame.data, "big") for frame in heard] == list(range(500))
    gateway.send_signal(signal.SIGINT)
    assert gateway.wait(WAIT_S) == Ending.INTERRUPTED
    lines = gateway.stderr.read().splitlines()
    assert all(" plant side: Articulation" in line for line in lines)
    assert sum("wrong CRC" in line for line in lines) == 2  # when it began, and how many there were


def test_faults_come_and_go_by_live_command(hubs, gateway, control):
    with (
        open_transport(f"hub:{hubs['plant'].path}") as machine,
        open_transport(f"hub:{hubs['ecu'].path}") as controller,
    ):

        def crosses(number):
            """Whether this sample arrives; another message behind it says that it had its time."""
            machine.send(Frame(SENSOR, bytes([number] * 8)))
            machine.send(Frame(SPEEDS, bytes([number] * 8)))
            heard = []
            while not heard or heard[-1].can_id != SPEEDS:
                assert select.select([controller.fileno()], [], [], WAIT_S)[0]
                heard += controller.drain()
            return any(frame.can_id == SENSOR for frame in heard)

        assert crosses(1)
        answer = ask(control, {"command": "inject", "fault": {"kind": "drop", "message": "Articulation"}})
        assert not crosses(2)
        figures = ask(control, {"command": "status"})["figures"]
        assert (figures["plant_received"], figures["ecu_sent"]) == (4, 3)
        ask(control, {"command": "clear", "number": answer["number"]})
        assert crosses(3)
        with pytest.raises(Refused, match="smash"):
            ask(control, {"command": "inject", "fault": {"kind": "smash"}})


def test_a_lost_hub_is_reported_in_one_line(hubs, gateway):
    hubs["ecu"].close()
    assert gateway.wait(WAIT_S) == Ending.HUB_LOST
    assert gateway.stderr.read() == f"loaderhil: lost the bus: {hubs['ecu'].path}: the hub is gone\n"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--plant-bus", "hub:@a", "--ecu-bus", "hub:@a"), Ending.MISUSED, "between two buses"),
        (("--routes", "nowhere.toml"), Ending.MISUSED, "nowhere.toml: cannot be read"),
        (("--dbc", "nowhere.dbc"), Ending.MISUSED, "nowhere.dbc: cannot read the DBC"),
        (("--plant-bus", "hub:@nobody"), Ending.HUB_LOST, "@nobody: no hub listens there"),
    ],
)
def test_misuse_is_one_line(words, code, message, tmp_path):
    result = subprocess.run(
        [sys.executable, "-m", "loaderhil", "gateway", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=WAIT_S,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.getcwd()},  # noqa: PTH109 - where the tests run
    )
    assert result.returncode == code
    assert len(result.stderr.splitlines()) == 1
    assert message in result.stderr
