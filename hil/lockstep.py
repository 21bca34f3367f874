"""Plant and ECU in one process on a virtual clock: bit-reproducible, far faster than real time.

Both sides are the same cores that run as processes in real time; every value passes the real
codec and a modelled wire. One tick of 10 ms:

    t        the plant advances to t, its sensor frames go onto the wire
    t + 5    the ECU has received them, ticks, its answers go onto the wire
    t + 10   the plant has received the answers, and the next tick begins

Where both sides can, frames go between them as rows of numbers, and become objects a hundred ticks at a time.

Nothing here reads a clock or draws a random number: equal arguments give equal bytes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from bus.frame import Frame
from bus.row_wire import ECU, PLANT, RowEcu, RowPlant, RowWire
from bus.rows import Frames, frames_of
from bus.wire import Carrier, Wire
from hil.shell.collector import uncollected

MS = 1_000_000
PERIOD_NS = 10 * MS
# Half a period after the plant: the ECU's ticks have a fixed phase, as if both clocks had been started together.
ECU_PHASE_NS = 5 * MS


TOGETHER_TICKS = 100
"""Ticks whose recorded frames are made together: one by one those of the reference cost a tenth of their tick."""


class CutOffError(Exception):
    """A side cannot go on with the run; the message says why. What was recorded until then stays."""


class PlantSide(Protocol):
    """The interface of a plant: `plant.unit.unit.PlantUnit`, or a fake."""

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]: ...

    def tick(self, now_ns: int) -> Sequence[Frame]: ...

    def reference_of(self, truths: Sequence[Any], first: int, at_ns: int) -> Sequence[Frame]:
        """Of ticks that follow one another, at which this was true; number and stamp of the first of them."""
        ...

    @property
    def truth(self) -> Any: ...

    @property
    def finished(self) -> bool: ...


class EcuTick(Protocol):
    """The result of one tick of the ECU."""

    @property
    def frames(self) -> Sequence[Frame]: ...

    @property
    def findings(self) -> Sequence[object]: ...


class EcuSide(Protocol):
    """The interface of an ECU: `ecu.cycle.EcuCycle`, or a fake."""

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]: ...

    def tick(self, now_ns: int) -> EcuTick: ...


@dataclass(slots=True)
class Recording:
    """The result of a lockstep run."""

    bus: Frames = field(default_factory=Frames)  # in the order of their stamps
    reference: Frames = field(default_factory=Frames)  # of the test instrumentation
    truth: list[Any] = field(default_factory=list)  # one per tick
    plant_findings: list[object] = field(default_factory=list)
    ecu_findings: list[object] = field(default_factory=list)


class Lockstep:
    """The bench of one run; `step` is one tick, `run` goes on until the plant has finished."""

    def __init__(
        self, plant: PlantSide, ecu: EcuSide, *, wire: Carrier | None = None, reference: bool = True
    ) -> None:
        """reference: whether to record the test instrumentation's frames, which the ECU never sees."""
        self._plant, self._ecu, self._wire = plant, ecu, wire or Wire()
        self._reference = reference
        self._rows: RowWire | None = None
        # a wire that was given may change, lose or add frames, and does so one by one
        if wire is None and isinstance(plant, RowPlant) and isinstance(ecu, RowEcu):
            self._rows = RowWire(plant.wanted)
        self._now_ns = 0
        self._recording = Recording()
        self._forgotten = 0  # ticks that `take` has given away
        self._instrumented = 0  # ticks whose reference frames have been made, those included

    @property
    def recording(self) -> Recording:
        """What has been recorded so far."""
        self._catch_up()
        return self._recording

    def take(self) -> Recording:
        """What has been recorded since the last call, and forget it: a run of hours does not fit into memory."""
        taken, self._recording = self.recording, Recording()
        self._forgotten = self._instrumented
        return taken

    @property
    def now_ns(self) -> int:
        """Virtual time of the next tick [ns]."""
        return self._now_ns

    def step(self) -> None:
        """One period: plant, wire, ECU, wire."""
        if self._forgotten + len(self._recording.truth) - self._instrumented >= TOGETHER_TICKS:
            self._catch_up()
        if self._rows is None:
            self._step_by_frames(self._now_ns)
        else:
            self._step_by_rows(self._rows, self._plant, self._ecu, self._now_ns)
        self._now_ns += PERIOD_NS

    def _step_by_rows(self, wire: RowWire, plant: Any, ecu: Any, now_ns: int) -> None:
        """plant: also a RowPlant; ecu: also a RowEcu."""
        recording, ecu_ns = self._recording, now_ns + ECU_PHASE_NS
        rows, count = plant.tick_rows(now_ns)
        recording.truth.append(plant.truth)
        wire.carry(rows, count, PLANT, now_ns, ecu_ns)
        rows, count, findings = ecu.cycle_rows(wire.take_to_ecu(), ecu_ns)
        recording.ecu_findings += findings
        wire.carry(rows, count, ECU, ecu_ns, now_ns + PERIOD_NS)
        for frame in wire.take_to_plant():
            if found := plant.receive(frame, frame[2]):
                recording.plant_findings += found

    def _step_by_frames(self, now_ns: int) -> None:
        recording, ecu_ns = self._recording, now_ns + ECU_PHASE_NS
        self._wire.put(self._plant.tick(now_ns), now_ns, "plant")
        recording.truth.append(self._plant.truth)
        self._deliver(ecu_ns)
        answer = self._ecu.tick(ecu_ns)
        recording.ecu_findings += answer.findings
        self._wire.put(answer.frames, ecu_ns, "ecu")
        self._deliver(now_ns + PERIOD_NS)

    def _catch_up(self) -> None:
        """Bring the recording up to the last tick: nobody reads it during the run."""
        if self._rows is not None:
            self._recording.bus.add(self._rows.take_bus())
        truths = self._recording.truth[self._instrumented - self._forgotten :]
        if self._reference and truths:
            first, plant = self._instrumented, self._plant
            if isinstance(plant, RowPlant):
                self._recording.reference.add(plant.reference_rows(truths, first, first * PERIOD_NS))
            else:
                self._recording.reference.extend(plant.reference_of(truths, first, first * PERIOD_NS))
        self._instrumented += len(truths)

    def _deliver(self, until_ns: int) -> None:
        """Hand every frame that has arrived to the other side."""
        recording, to_plant, to_ecu = self._recording, self._plant.receive, self._ecu.receive
        arrived = self._wire.take(until_ns)
        recording.bus.extend([frame for _, frame in arrived])
        for sender, frame in arrived:
            if sender != "plant":
                # nearly no frame has a finding
                if found := to_plant(frame, frame[2]):
                    recording.plant_findings += found
            elif found := to_ecu(frame, frame[2]):
                recording.ecu_findings += found

    def run(self, progress: Callable[[float], None] | None = None, *, every: int = 50) -> Recording:
        """Step until the plant has finished; `progress` receives the simulated seconds every `every` ticks."""
        ticks = 0
        try:
            # a tick leaves no cycles, and searching the growing recording for some takes a tenth of the run
            with uncollected():
                while not self._plant.finished:
                    self.step()
                    ticks += 1
                    if progress is not None and ticks % every == 0:
                        progress(self._now_ns * 1e-9)
        finally:
            self._receive_the_rest()
        return self.recording

    def _receive_the_rest(self) -> None:
        """Hand over the frames that came after the last cycle: they may have findings too."""
        for frame in frames_of(self._rows.take_to_ecu()) if self._rows is not None else ():
            self._recording.ecu_findings += self._ecu.receive(frame, frame.at_ns)
