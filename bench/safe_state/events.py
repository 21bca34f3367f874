"""One event at a driving machine, and how soon the machine is on its safe limits."""

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.safe_state.machine import DrivingMachine, Tick
from bench.safe_state.wires import MACHINE, KernelWire, SerialWire
from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.transport import SocketCanTransport
from dbc import loader_database

TICK_S: Final = 0.01
CUT: Final = ("kill -9", "interface down", "unplug", "bus-off")
"""Events after which no frame of the ECU reaches the machine."""
BESIDE: Final = ("nothing", "full disk", "clock step")
"""Events beside the ECU, which must not reach the machine at all. What the machine sees when nothing happens is the host's doing."""
BROKEN: Final = ("broken configuration",)
EVENTS: Final = (*CUT, *BESIDE, *BROKEN)
WATCHED_S: Final = 2.0  # after an event beside the ECU
HELD_UP_S: Final = 0.03
"""Inputs of three cycles' age are stale: a machine whose own ticks are so far apart gets safe limits, whatever else happens."""
FELT_S: Final = 0.2
"""Within so long the ECU's answer to stale inputs is there."""
RUNNING_TICKS: Final = 50
OWN: Final = {c.can_id for c in loader_database().by_name.values() if "EstimatorEcu" in c.senders}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one event came to. Times count from the event."""

    declared_s: float  # of the equipment: age of the last limits beyond which the machine takes its safe ones
    late_s: float  # longest time between two ticks of the machine after the event: how busy this host was
    safe_after_s: float | None = None  # first tick with safe limits in force; None: there was none
    unforced_s: float | None = None  # likewise, where the machine itself was not held up just before
    slow_after_s: float | None = None  # speed within the safe limit
    back_after_s: float | None = None  # limits of the ECU in force again, after it could send again
    longest_gap_s: float = 0.0  # between two Limits frames that the machine used
    frames: int = 0  # of the ECU, where it must not send any
    exit_code: int | None = None  # of the process that must end


@dataclass(frozen=True, slots=True)
class EcuProgram:
    """How an ECU is started; words: without the interface."""

    name: str
    words: tuple[str, ...]
    broken: tuple[str, ...]  # options that make its configuration wrong

    def on(self, interface: str, *more: str) -> subprocess.Popen[bytes]:
        """Start it."""
        return subprocess.Popen(
            [*self.words, "--bus", f"socketcan:{interface}", *more], stderr=subprocess.DEVNULL
        )


def python_ecu(folder: Path) -> EcuProgram:
    """`loaderhil ecu`; its broken configuration is a calibration with a mass of the wrong unit."""
    file = folder / "broken.toml"
    file.write_text('base = "l60"\n[front]\nmass_kg = "heavy"\n')
    words = (sys.executable, "-m", "loaderhil", "ecu")
    return EcuProgram("python", words, ("--calibration", str(file)))


def c_ecu(program: Path) -> EcuProgram:
    """`linux/loader-ecu`; its calibration is compiled, so that only its options can be wrong."""
    return EcuProgram("c", (str(program),), ("--fifo", "1000"))


def measured(ecu: EcuProgram, event: str) -> Outcome:
    """Let the event happen once."""
    with tempfile.TemporaryDirectory() as folder:
        if event in BROKEN:
            return _broken(ecu, Path(folder))
        wire = SerialWire() if event == "bus-off" else KernelWire()
        with wire, DrivingMachine(MACHINE, Path(folder)) as machine:
            running = [ecu.on(wire.interface)]
            try:
                machine.wait(_driving, "the ECU runs", hold=RUNNING_TICKS)
                if event == "full disk":
                    return _full_disk(machine, Path(folder))
                if event == "clock step":
                    return _clock_step(machine)
                if event == "nothing":
                    return _watched(machine, time.monotonic_ns())
                return _cut(ecu, event, wire, machine, running)
            finally:
                for process in running:
                    process.kill()
                    process.wait()


def _driving(tick: Tick) -> bool:
    """Whether the machine drives by the ECU's limits, faster than its own would permit."""
    return not tick.safe and tick.speed > 3.0


def _cut(
    ecu: EcuProgram,
    event: str,
    wire: KernelWire | SerialWire,
    machine: DrivingMachine,
    running: list[subprocess.Popen[bytes]],
) -> Outcome:
    """The ECU falls silent, and comes back."""
    event_ns = time.monotonic_ns()
    if isinstance(wire, SerialWire):
        wire.bus_off()
    elif event == "kill -9":
        running[0].send_signal(signal.SIGKILL)
    elif event == "interface down":
        wire.down()
    else:
        wire.remove()
    safe = machine.wait(lambda tick: tick.safe and tick.at_ns > event_ns, "safe limits")
    limit = machine.obedience.safe.speed + machine.obedience.retard
    slow = machine.wait(lambda tick: tick.speed <= limit, "slow enough")
    back_ns = time.monotonic_ns()
    if isinstance(wire, SerialWire):
        wire.restart()
    elif event == "kill -9":
        running.append(ecu.on(wire.interface))
    elif event == "interface down":
        wire.up()
    else:
        wire.plug()
    back = machine.wait(lambda tick: not tick.safe and tick.at_ns > back_ns, "limits of the ECU again")
    return Outcome(
        declared_s=machine.obedience.stale_after,
        late_s=_late(machine.ticks, event_ns, safe.at_ns),
        safe_after_s=(safe.at_ns - event_ns) * 1e-9,
        slow_after_s=(slow.at_ns - event_ns) * 1e-9,
        back_after_s=(back.at_ns - back_ns) * 1e-9,
    )


def _late(ticks: Sequence[Tick], event_ns: int, until_ns: int) -> float:
    """Longest time between two ticks, from the last one before the event up to a moment."""
    return (
        max(
            (b.at_ns - a.at_ns for a, b in itertools.pairwise(ticks) if event_ns < b.at_ns <= until_ns),
            default=0,
        )
        * 1e-9
    )


def _watched(machine: DrivingMachine, event_ns: int, exit_code: int | None = None) -> Outcome:
    """What the machine has seen since an event that must not have reached it."""
    time.sleep(WATCHED_S)
    ticks = machine.after(event_ns)
    safe = [tick.at_ns for tick in ticks if tick.safe]
    unforced = unforced_of(machine.ticks, event_ns)
    return Outcome(
        declared_s=machine.obedience.stale_after,
        late_s=_late(machine.ticks, event_ns, ticks[-1].at_ns),
        safe_after_s=(safe[0] - event_ns) * 1e-9 if safe else None,
        unforced_s=None if unforced is None else (unforced - event_ns) * 1e-9,
        longest_gap_s=max(tick.limits_age_s for tick in ticks),
        exit_code=exit_code,
    )


def unforced_of(ticks: Sequence[Tick], event_ns: int) -> int | None:
    """When safe limits began after an event without a late tick of the machine just before; None: never.

    The machine and the ECU share one processor with the event: a machine that is not run for three cycles sends no inputs, and the
    ECU's answer to that is no answer to the event.
    """
    held_up_ns = -(1 << 62)
    for before, tick in itertools.pairwise(ticks):
        if tick.at_ns - before.at_ns >= HELD_UP_S * 1e9:
            held_up_ns = tick.at_ns
        begins = tick.safe and not before.safe and tick.at_ns > event_ns
        if begins and tick.at_ns - held_up_ns > FELT_S * 1e9:
            return tick.at_ns
    return None


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A file system of 256 KiB."""
    place = folder / "disk"
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "disk", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def _full_disk(machine: DrivingMachine, folder: Path) -> Outcome:
    """A recorder beside the ECU fills its disk; the event begins when the recorder writes."""
    with small_disk(folder) as disk:
        file = disk / "bus.log"
        words = ["record", f"loader=socketcan:{MACHINE}", "--out", str(file)]
        recorder = subprocess.Popen([sys.executable, "-m", "loaderhil", *words], stderr=subprocess.DEVNULL)
        try:
            # its start, a Python program on the only processor, is none of the disk's doing
            while recorder.poll() is None and not (file.exists() and file.stat().st_size):
                time.sleep(0.01)
            written_ns = time.monotonic_ns()
            code = recorder.wait(timeout=100.0)
        finally:
            recorder.kill()
            recorder.wait()
        return _watched(machine, written_ns, code)


def _clock_step(machine: DrivingMachine) -> Outcome:
    """Somebody sets the clock an hour on, and back."""
    event_ns = time.monotonic_ns()
    for hours in (1, -1):
        now = time.clock_gettime(time.CLOCK_REALTIME)
        time.clock_settime(time.CLOCK_REALTIME, now + hours * 3600)
        time.sleep(WATCHED_S / 2)
    return _watched(machine, event_ns)


def _broken(ecu: EcuProgram, folder: Path) -> Outcome:
    """The ECU is started with a configuration that it has to refuse; the event is the machine's start."""
    with (
        KernelWire() as wire,
        SocketCanTransport(wire.interface) as witness,
        DrivingMachine(MACHINE, folder) as machine,
    ):
        process = ecu.on(wire.interface, *ecu.broken)
        try:
            code = process.wait(timeout=100.0)
        finally:
            process.kill()
            process.wait()
        frames = 0
        while heard := witness.drain(4096):
            frames += sum(frame.can_id in OWN for frame in heard)
        safe = machine.wait(lambda tick: tick.safe, "safe limits")
        first = next(tick for tick in machine.ticks if tick.safe)
        assert first.at_ns <= safe.at_ns
        begun_ns = machine.ticks[0].at_ns
        return Outcome(
            declared_s=machine.obedience.stale_after,
            late_s=_late(machine.ticks, begun_ns, first.at_ns),
            safe_after_s=(first.at_ns - begun_ns) * 1e-9,
            frames=frames,
            exit_code=code,
        )


def can_be_measured() -> bool:
    """Whether this is user-mode Linux with CAN: a kernel of our own, whose clock and disks nobody else uses."""
    return kernel_has_can() and os.geteuid() == 0 and "User Mode Linux" in Path("/proc/cpuinfo").read_text()
