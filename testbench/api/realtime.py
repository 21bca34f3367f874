"""The bench in real time under a test: `loaderhil run --gateway` as a process, heard and stimulated from outside."""

import asyncio
import contextlib
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bus.address import open_transport
from bus.frame import Frame
from bus.hub.client import hub_status
from bus.transport import BusUnavailable
from bus.user_error import UserError
from dbc import loader_database
from dbc.database import Database
from hil.faults.control import ask
from hil.processes.supervisor import loaderhil
from testbench.api.listening import Listener

# A hub listens within a second; a machine that compiles beside it may keep it waiting. [s]
HUB_S = 30.0
READY_S = 240.0
"""For the first frame of the machine: compiling takes a minute on a small computer."""
# For a run to write its folder after SIGTERM [s]; then it is killed and its folder is incomplete.
END_S = 30.0


class NotStarted(UserError, RuntimeError):
    """The bench in real time did not start; the message has what it said."""


class RealtimeDriven:
    """A run with a gateway; the test sits on the machine's bus."""

    def __init__(self, scenario: str, ecu: str | None, seed: int | None) -> None:
        self._words = [
            scenario,
            *(["--ecu", ecu] if ecu else []),
            *(["--seed", str(seed)] if seed is not None else []),
        ]
        # Paths of Unix sockets have to be short, so the run gets a folder of its own.
        self._folder = Path(tempfile.mkdtemp(prefix="loaderhil-"))
        self._processes: list[subprocess.Popen[bytes]] = []
        self._listener: Listener | None = None

    @property
    def database(self) -> Database:
        """That of machine and ECU."""
        return loader_database()

    @property
    def now_s(self) -> float:
        """Since the machine's first frame."""
        return self._listener.now_s if self._listener is not None else 0.0

    @property
    def record(self) -> Sequence[Frame]:
        """Every frame on the machine's bus so far."""
        return self._listener.record if self._listener is not None else ()

    async def start(self) -> None:
        """Start hub and run, and wait for the first frame; NotStarted with what the run said."""
        hub, said = self._folder / "hub", self._folder / "said"
        # a hub of our own and not one of the run's: the test has to be on the bus before the first frame
        self._spawn(loaderhil("hub", "--bus", f"hub:{hub}"), said)
        async with asyncio.timeout(HUB_S):
            while not _there(hub):  # noqa: ASYNC110 - another process makes the socket
                await asyncio.sleep(0.05)
        self._listener = Listener(open_transport(f"hub:{hub}", name="test"))
        run = [
            # only a gateway can change frames between machine and ECU, which is what a stimulus does
            "run", *self._words, "--gateway", "--plant-bus", f"hub:{hub}",
            "--control", str(self._control), "--out", str(self._folder / "run"),
        ]  # fmt: skip
        process = self._spawn(loaderhil(*run), said)
        try:
            async with asyncio.timeout(READY_S):
                # the first frame alone is not enough: a stimulus needs the control socket, which the gateway opens
                while self._listener.zero_ns is None or not self._control.exists():
                    if process.poll() is not None:
                        raise NotStarted(f"the run ended with {process.returncode}: {_last_words(said)}")
                    await self._listener.frames(0.0)
                    await asyncio.sleep(0.02)
        except TimeoutError:
            raise NotStarted(f"no frame of the machine within {READY_S:g} s: {_last_words(said)}") from None

    @property
    def _control(self) -> Path:
        return self._folder / "control"

    def _spawn(self, words: list[str], said: Path) -> "subprocess.Popen[bytes]":
        with said.open("ab") as log:
            self._processes.append(subprocess.Popen(words, stdout=log, stderr=log, stdin=subprocess.DEVNULL))
        return self._processes[-1]

    async def advance(self, until_s: float) -> Sequence[Frame] | None:
        """Wait for frames; None when the run is over."""
        assert self._listener is not None
        frames = await self._listener.frames(until_s)
        # frames first: those that came before the run ended are still to be judged
        return None if not frames and self._processes[-1].poll() is not None else frames

    def truth(self) -> Mapping[str, Any]:
        """None while the run goes on: the truth stays inside the plant's process."""
        return {}

    def stimulate(self, message: str, signal: str, value: float) -> None:
        """As a sensor that is stuck at a value, in the gateway."""
        self.inject({"kind": "freeze", "message": message, "signal": signal, "value": value})

    def inject(self, fault: Mapping[str, object]) -> str:
        """Refused with the injector's reason."""
        return str(ask(self._control, {"command": "inject", "fault": dict(fault)})["fault"])

    def clear(self) -> None:
        """End every fault."""
        ask(self._control, {"command": "clear"})

    async def stop(self) -> None:
        """End the run, then the hub."""
        # the run before its hub: without a bus it would end as lost instead of finishing its files
        for process in reversed(self._processes):
            process.terminate()
            try:
                await asyncio.to_thread(process.wait, END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._processes.clear()
        if self._listener is not None:
            self._listener.close()

    def keep(self, folder: Path) -> Path:
        """The run directory."""
        if (self._folder / "run").is_dir():
            shutil.copytree(self._folder / "run", folder, dirs_exist_ok=True)
        return folder

    def __del__(self) -> None:
        # at the end of the interpreter modules may be gone; a folder under /tmp is no reason for an error
        with contextlib.suppress(Exception):
            shutil.rmtree(self._folder, ignore_errors=True)


def _there(hub: Path) -> bool:
    try:
        hub_status(str(hub))
    except BusUnavailable:
        return False
    return True


def _last_words(said: Path) -> str:
    lines = said.read_text("utf-8", "replace").strip().splitlines()
    return " ".join(lines[-3:]) or "it said nothing"
