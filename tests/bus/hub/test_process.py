"""The hub as a process of its own: signals and sudden ends."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bus.hub.client import HubTransport
from bus.transport import BusClosed
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S, readable

SERVE = "import sys; from bus.hub.server import serve; serve(sys.argv[1], on_ready=lambda: print('ready', flush=True))"


@pytest.mark.processes
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_hub_process_and_leaves_nothing_behind(path: str, number: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", SERVE, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        with HubTransport(path) as client:
            process.send_signal(number)
            assert process.wait(WAIT_S) == 0
            with pytest.raises(BusClosed):
                client.drain()
    assert not Path(path).exists()


@pytest.mark.processes
def test_a_killed_hub_is_noticed_and_its_address_can_be_served_again(path: str) -> None:
    with subprocess.Popen([sys.executable, "-c", SERVE, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with HubTransport(path) as client:
            process.kill()
            assert readable(client, WAIT_S)
            with pytest.raises(BusClosed, match="the hub is gone"):
                client.drain()
    running = RunningHub(path)
    running.connect().close()
    running.stop()
