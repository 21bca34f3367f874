"""The bench in lockstep under a test: one tick of 10 ms per step, on the virtual clock."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bus.frame import Frame
from dbc import loader_database
from dbc.database import Database
from hil import rundir
from hil.compose import Choice, lockstep
from hil.faults.injector import Injector
from hil.faults.record import injected, write_faults
from hil.lockstep import Lockstep
from hil.runs import write_recording
from plant.truth import columns_of
from testbench.api.driven import NotPossible

# A step waits for nothing, so the loop would get no turn by itself; a turn per tick would cost more than it gives.
TURN_TICKS = 20
"""Ticks between two chances for other tasks of the event loop."""


class LockstepDriven:
    """A `Lockstep` that is stepped on demand."""

    def __init__(self, scenario: str, choice: Mapping[str, Any]) -> None:
        self._choice = Choice(scenario=scenario, **choice)
        self._scenario = self._choice.load()
        self._bench: Lockstep | None = None
        self._injector: Injector | None = None
        self._given = 0
        self._ticks = 0

    @property
    def database(self) -> Database:
        """That of machine and ECU."""
        return loader_database()

    @property
    def now_s(self) -> float:
        """Virtual time of the next tick."""
        return self._bench.now_ns * 1e-9 if self._bench is not None else 0.0

    @property
    def record(self) -> Sequence[Frame]:
        """Every frame so far."""
        return self._bench.recording.bus if self._bench is not None else ()

    async def start(self) -> None:
        """Settle the machine."""
        # Always with an injector, so that a test can stimulate at any time.
        self._injector = self._choice.injector() or Injector(loader_database(), (), seed=self._scenario.seed)
        self._bench = lockstep(
            self._scenario,
            form=self._choice.form,
            limits=self._choice.limits,
            injector=self._injector,
            calibration=self._choice.calibration,
            core=self._choice.core,
        )

    async def advance(self, until_s: float) -> Sequence[Frame] | None:
        """One tick; None when the scenario is over."""
        assert self._bench is not None
        recording = self._bench.recording
        # the first tick is always made, so that a scenario of zero length has a truth to look at
        if recording.truth and self._bench.now_ns >= round(self._scenario.duration_s * 1e9):
            return None
        self._bench.step()
        self._ticks += 1
        if self._ticks % TURN_TICKS == 0:
            await asyncio.sleep(0)
        # the recording is the queue: what is new lies behind what was given before
        frames, self._given = recording.bus[self._given :], len(recording.bus)
        return frames

    def truth(self) -> Mapping[str, Any]:
        """Of the newest tick."""
        if self._bench is None or not self._bench.recording.truth:
            return {}
        columns = columns_of(self._bench.recording.truth[-1].row.reshape(1, -1))
        return {name: column[0] for name, column in columns.items()}

    def stimulate(self, message: str, signal: str, value: float) -> None:
        """As a sensor that is stuck at a value."""
        self.inject({"kind": "freeze", "message": message, "signal": signal, "value": value})

    def inject(self, fault: Mapping[str, object]) -> str:
        """NotPossible with the reason if the injector refuses it."""
        assert self._injector is not None
        assert self._bench is not None
        # by the same command as `loaderhil inject`, so that both refuse the same faults with the same words
        answer = self._injector.command({"command": "inject", "fault": dict(fault)}, self._bench.now_ns)
        if not answer["ok"]:
            raise NotPossible(str(answer["error"]))
        return str(answer["fault"])

    def clear(self) -> None:
        """End every fault."""
        assert self._injector is not None
        assert self._bench is not None
        self._injector.command({"command": "clear"}, self._bench.now_ns)

    async def stop(self) -> None:
        """Nothing runs between steps."""

    def keep(self, folder: Path) -> Path:
        """A run directory of what was driven so far."""
        assert self._bench is not None
        assert self._injector is not None
        record = self._choice.record(self._scenario, "lockstep")
        rundir.begin(folder, record)
        recording = self._bench.recording
        lost = write_recording(folder, recording)
        # faults that are still active get their end here; the report draws them as bars
        self._injector.finish(self._bench.now_ns)
        write_faults(folder, injected(self._injector.events))
        duration_s = float(recording.truth[-1].time_s) if recording.truth else 0.0
        outcome: rundir.Outcome = "failed" if lost else "finished"
        rundir.write_record(
            folder, replace(record, outcome=outcome, reason="; ".join(lost), duration_s=duration_s)
        )
        return folder
