"""One run as processes: hubs, recorders, gateway, ECU and plant, each its own `loaderhil` command, in real time.

The supervisor starts them, waits until all are ready (compiled, connected), sends go, and
ends all of them with the first that ends. The result is a run directory, complete or
with the reason why not.
"""

import contextlib
import shutil
import signal
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hil import rundir
from hil.check.observed import punctuality_of
from hil.compose import Choice, ChoiceError, calibration_of
from hil.ending import Ending
from hil.gateway import latency
from hil.gateway.buses import ONE_BUS, Buses
from hil.gateway.routes import Side
from hil.processes.supervisor import Child, Event, StartFailed, Supervisor, loaderhil
from hil.rundir import RunDirectory, RunRecord
from hil.runs import RunResult
from hil.shell.realtime_options import ORDINARY, RealtimeOptions
from hil.timing.vitals import SAMPLE_S, Watch, with_children
from hil.timing.waits import Rows

HUB_READY_S = 20.0
READY_S = 180.0
"""Longest start of a process [s], compilation included, which is slow the first time on a small machine."""
STUCK_S = 20.0
"""Longest standstill of the plant's time [s]; on a busy machine it is slower than the clock, but it moves."""
NODE_OF: dict[Side, str] = {"plant": "Machine", "ecu": "EstimatorEcu"}
LOST = (-signal.SIGKILL, -signal.SIGTERM, Ending.HUB_LOST, Ending.PEER_DIED)
"""Exit codes of a process that another one caused, or that waited for a node in vain."""
CAUSE_S = 1.0
"""How long to look for the first cause when one failure ends several processes [s]."""


@contextmanager
def _sigterm_interrupts() -> Iterator[None]:
    """Let SIGTERM end a run as Ctrl-C does: processes are stopped and files written."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def socket_folder() -> Iterator[Path]:
    """A temporary folder for the sockets of a run: the name of a Unix socket has at most 107 bytes."""
    folder = Path(tempfile.mkdtemp(prefix="loaderhil-"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run_realtime(
    choice: Choice,
    out: Path,
    on_event: Callable[[str, Event], None] | None = None,
    buses: Buses = ONE_BUS,
    options: RealtimeOptions = ORDINARY,
) -> RunResult:
    """Run `choice` as processes and write the run directory `out`. options: for all processes but the recorders."""
    scenario = choice.load()
    # on one bus nothing stands between the sides that could change frames
    if not buses.gateway and choice.injector() is not None:
        raise ChoiceError(
            f"{choice.scenario}: has faults to inject; add --gateway to do so in real time, or run in lockstep"
        )
    record = choice.record(scenario, "realtime")
    record = replace(record, foreign={str(side): address for side, address in buses.foreign.items()})
    rundir.begin(out, record)
    with _sigterm_interrupts(), socket_folder() as folder, Supervisor(on_event) as supervisor:
        bench = _Bench(supervisor, choice, buses, options, folder, out)
        try:
            ending, reason = bench.drive()
        except StartFailed as error:
            ending, reason = Ending.FAILED, str(error)
            if error.ended is not None and error.ended.process.returncode in LOST:
                ending, reason = _cause(supervisor, bench.hubs, error.ended)
        except KeyboardInterrupt:
            ending, reason = Ending.INTERRUPTED, "interrupted"
        figures = _stop_in_order(supervisor)
        waits = _waits(supervisor)
    record = replace(_ended(record, ending, reason, figures), vitals=bench.watch.vitals())
    # first: where the disk is full, at least how and why the run ended is known
    rundir.write_record(out, record)
    try:
        record = _concluded(out, record, waits)
    except rundir.RunError as error:
        # the rows and stamps of the processes stay, from which the files would have been made
        ending, reason = (
            Ending.FAILED if ending is Ending.PASSED else ending,
            "; ".join(filter(None, (reason, str(error)))),
        )
        record = replace(record, outcome="failed", reason=reason)
        with contextlib.suppress(rundir.RunError):
            rundir.write_record(out, record)
    return RunResult(ending, reason, record)


def _concluded(out: Path, record: RunRecord, waits: dict[str, Rows]) -> RunRecord:
    """Make truth and timing of what the processes wrote, and judge them. RunError where the disk takes no more."""
    rundir.keep_truth(out)
    latency.conclude(out, record)
    if waits:
        rundir.write_table(rundir.part_of_timing(out, "waits"), waits)
    rundir.merge_timing(out)
    # judged from the files, after they are complete; then written into run.json
    record = replace(record, punctuality=punctuality_of(RunDirectory.read(out)))
    rundir.write_record(out, record)
    return record


class _Bench:
    """The processes of one run."""

    def __init__(
        self,
        supervisor: Supervisor,
        choice: Choice,
        buses: Buses,
        options: RealtimeOptions,
        folder: Path,
        out: Path,
    ) -> None:
        self._supervisor = supervisor
        self._choice, self._buses, self._options = choice, buses, options
        self._folder, self._out = folder, out
        self.watch = Watch()
        self.hubs: list[Child] = []

    def drive(self) -> tuple[Ending, str]:
        """Start all processes and wait for the end; returns how the run ended, and why."""
        supervisor = self._supervisor
        self.hubs = hubs = self._start_hubs()
        plant, recorders = self._start_plant(), self._start_recorders()
        # The ECU sends as soon as it is ready, and its first frames belong to the record. The plant loads
        # meanwhile, because it waits for go.
        supervisor.wait_ready(recorders, READY_S)
        others = self._start_others()
        supervisor.wait_ready([*others, plant] if plant else others, READY_S)
        # only now: a foreign node is waited for by people
        attendants = self._start_attendants()
        supervisor.wait_ready(attendants, READY_S + self._buses.wait_s)
        plant = plant or attendants[0]
        self._look()
        # by id: against a foreign machine the plant is the attendant, and go must be sent once
        for child in {id(child): child for child in (plant, *attendants)}.values():
            supervisor.go(child)
        reached_s, moved_s = plant.reached_s, time.monotonic()
        while (first := supervisor.wait_first_end(SAMPLE_S)) is None:
            self._look()
            if plant.reached_s != reached_s:
                reached_s, moved_s = plant.reached_s, time.monotonic()
            elif time.monotonic() - moved_s > STUCK_S:
                return Ending.FAILED, (
                    f"the plant's time has stood still at {reached_s:.1f} s for {STUCK_S:.0f} s"
                )
        # the plant decides the end: its scenario is over
        if first is plant and plant.finished:
            return Ending.PASSED, ""
        return _cause(supervisor, hubs, first)

    def _start_plant(self) -> Child | None:
        """The plant process; None where a foreign machine replaces it."""
        if "plant" in self._buses.foreign:
            return None
        options = [*self._choice.arguments(), *self._options.words(), "--out", str(self._out)]
        bus = self._buses.addresses(self._folder)["plant"]
        return self._supervisor.start("plant", loaderhil("plant", *options, "--bus", bus), vital=True)

    def _start_attendants(self) -> list[Child]:
        """A process that waits for the foreign node, if there is one; against a foreign machine it also ends the run."""
        children = []
        for side, address in self._buses.foreign.items():
            words = [address, "--node", NODE_OF[side], "--wait-s", repr(self._buses.wait_s)]
            if side == "plant":
                words += ["--for-s", repr(float(self._choice.load().duration_s))]
            children.append(self._supervisor.start("attend", loaderhil("attend", *words), vital=True))
        return children

    def _look(self) -> None:
        """Sample memory and waiting times of the running processes."""
        running = [c for c in self._supervisor.children if c.ready and not c.ended]
        processes = with_children((child.name, child.process.pid) for child in running)
        self.watch.sample(processes, time.monotonic_ns())

    def _start_hubs(self) -> list[Child]:
        words = self._options.words(above=1)  # the hub runs before its clients: a frame waits for it twice
        hubs = [
            self._supervisor.start(name, loaderhil("hub", "--bus", address, *words))
            for name, address in self._buses.own_hubs(self._folder).items()
        ]
        self._supervisor.wait_ready(hubs, HUB_READY_S)
        return hubs

    def _start_recorders(self) -> list[Child]:
        on, start = self._buses.addresses(self._folder), self._supervisor.start
        recorders = [start("recorder", _record(f"loader={on['plant']}", self._out / rundir.BUS))]
        if self._buses.gateway:
            recorders.append(
                start("ecu-recorder", _record(f"loader={on['ecu']}", self._out / rundir.ECU_BUS))
            )
        return recorders

    def _start_others(self) -> list[Child]:
        """Gateway and ECU."""
        choice, out, start = self._choice, self._out, self._supervisor.start
        on = self._buses.addresses(self._folder)
        words = [*self._options.words(), "--out", str(out)]
        others = []
        if self._buses.gateway:
            others.append(start("gateway", loaderhil("gateway", *_between(on, self._buses, choice), *words)))
        form = [
            "--form",
            choice.form,
            "--calibration",
            calibration_of(choice.load(), choice.calibration),
            "--core",
            choice.core.name,
            *([] if choice.limits else ["--no-limits"]),
            "--detect-faults" if choice.detect_faults else "--no-detect-faults",
        ]
        if "ecu" not in self._buses.foreign:
            others.append(start("ecu", loaderhil("ecu", "--bus", on["ecu"], *form, *words)))
        return others


def _record(bus: str, log: Path) -> list[str]:
    return loaderhil("record", bus, "--out", str(log), "--monotonic")


def _between(on: dict[Side, str], buses: Buses, choice: Choice) -> list[str]:
    """The options of the gateway."""
    words = ["--plant-bus", on["plant"], "--ecu-bus", on["ecu"]]
    if buses.routes is not None:
        words += ["--routes", str(buses.routes)]
    if buses.control is not None:
        words += ["--control", str(buses.control)]
    if choice.injector() is not None:
        words += [word for file in choice.fault_files() for word in ("--inject", str(file))]
        words += ["--seed", str(choice.load().seed)]
    return words


def _cause(supervisor: Supervisor, hubs: list[Child], first: Child) -> tuple[Ending, str]:
    """How the run ended and which process caused it: one that only reports the loss of a hub is not the cause."""
    if first not in hubs and first.process.returncode == Ending.HUB_LOST:
        for hub in hubs:
            supervisor.wait_end(hub, CAUSE_S / len(hubs))
        first = next((hub for hub in hubs if hub.ended), first)
    lost_hub = first in hubs or first.process.returncode == Ending.HUB_LOST
    return (Ending.HUB_LOST if lost_hub else Ending.PEER_DIED), first.how_it_ended()


def _stop_in_order(supervisor: Supervisor) -> dict[str, Event]:
    """Stop plant and ECU first, so that the recorder receives their last frames and the hub ends last; their figures by name."""
    supervisor.stop_all()
    return {child.name: child.figures for child in supervisor.children}


def _waits(supervisor: Supervisor) -> dict[str, Rows]:
    """Waits for a processor, by process; a process that was started again has the waits of all its lives."""
    waits: dict[str, array[int]] = {}
    for child in supervisor.children:
        waits.setdefault(child.name, array("q")).extend(child.waits)
    return {name: np.array(of, np.int64).reshape(-1, 3) for name, of in waits.items() if of}


OUTCOMES: dict[Ending, rundir.Outcome] = {Ending.PASSED: "finished", Ending.INTERRUPTED: "interrupted"}


def _ended(record: RunRecord, ending: Ending, reason: str, figures: dict[str, Event]) -> RunRecord:
    """The record of a run that is over, with the figures of its processes as PROCESS_FIGURE."""
    named = {f"{name}_{key}": value for name, event in figures.items() for key, value in event.items()}
    return replace(
        record,
        outcome=OUTCOMES.get(ending, "failed"),
        reason=reason,
        duration_s=float(named.get("plant_duration_s", named.get("attend_duration_s", 0.0))),
        statistics=named,
    )
