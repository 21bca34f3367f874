"""How signals end the processes of the bench."""

import asyncio
import os
import signal

import pytest

from bus.transport import BusClosed
from hil.shell.process import run_until_signal
from hil.timing.host import Sleeps


class SignalledWhileClosing(Sleeps):
    """A supervisor that sends SIGTERM just while the event loop of a process closes."""

    def close(self) -> None:
        """As the base class, after the signal."""
        os.kill(os.getpid(), signal.SIGTERM)
        super().close()


async def lose_the_bus() -> None:
    """The work of a process whose bus ends."""
    raise BusClosed("the hub is gone")


def test_a_signal_that_comes_while_the_loop_closes_adds_nothing_to_the_report(capfd):
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(BusClosed, match="the hub is gone"):
        run_until_signal(lose_the_bus(), SignalledWhileClosing())
    assert capfd.readouterr() == ("", "")
    assert signal.getsignal(signal.SIGTERM) == before
    assert signal.set_wakeup_fd(-1) == -1


def test_a_signal_cancels_the_work():
    async def signalled() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        await asyncio.sleep(60.0)

    assert run_until_signal(signalled())
