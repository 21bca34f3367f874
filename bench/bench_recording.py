"""Recording 40 000 frames/s from ten buses for a minute: frames lost, and processor time against python-can's Logger.

    python -m bench.bench_recording [SECONDS [FRAMES_PER_SECOND]]

Ten hubs stand for ten buses. A generator sends on all of them at the given rate, in bursts of a millisecond; `loaderhil
record` and, at the same time, one can.Logger per bus in a process of its own (Notifier and CanutilsLogWriter) record.
Processor time is that of the recorders' processes, user and system. Every frame carries its number; the file must hold each of
them once and in order. The hubs and the generator share the processors, so frames lost before a recorder are counted separately.
"""

import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from bus.hub.client import wait_for_hub
from dbc.recordings.reading import read_frames

BUSES = 10
BURST_S = 0.001
QUIET_S = 0.05  # processor time in two seconds that counts as idle
FORMATS = (".log", ".blf", ".mf4")

PEER = """
import signal, sys, can
paths, folder = sys.argv[2:], sys.argv[1]
buses = [can.Bus(interface="loaderhil", channel=path) for path in paths]
writers = [can.Logger(f"{folder}/peer{k}.log") for k in range(len(buses))]
notifiers = [can.Notifier(bus, [writer]) for bus, writer in zip(buses, writers)]
print("ready", flush=True)
signal.sigwait([signal.SIGTERM])
for notifier in notifiers: notifier.stop(timeout=10)
for writer in writers: writer.stop()
for bus in buses: bus.shutdown()
"""
GENERATOR = """
import sys, time
from bus.frame import EXTENDED, Frame
from bus.hub.client import HubTransport
rate, seconds, paths = float(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]
buses = [HubTransport(path, name="generator") for path in paths]
start, sent, refused = time.monotonic(), [0] * len(buses), 0
while (elapsed := time.monotonic() - start) < seconds:
    due = int(elapsed * rate / len(buses))
    for k, bus in enumerate(buses):
        while sent[k] < due and bus.send(Frame(0x18FEF100 | EXTENDED, sent[k].to_bytes(8, "big"))):
            sent[k] += 1
        refused += sent[k] < due
    time.sleep(BURST_S)
print(sum(sent), refused)
""".replace("BURST_S", str(BURST_S))


def used_s(process: subprocess.Popen) -> float:
    """Processor time of a process and its living children so far [s]."""
    pids = [
        process.pid,
        *map(int, Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()),
    ]
    ticks = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def settled_s(process: subprocess.Popen) -> float:
    """The same once the process has nothing more to do: what waits in its sockets is its work too."""
    # the generator may end before the recorder has written everything it took
    used, before = used_s(process), -1.0
    while used - before > QUIET_S:
        time.sleep(2)
        used, before = used_s(process), used
    return used


def complete(path: Path) -> int:
    """Frames in the file; an error if of any channel one is missing between two others, twice or out of order."""
    table = read_frames(path)
    assert table.damaged_count == 0, table.damaged
    # the generator writes the number of each frame as its content, big-endian
    numbers = table.data[:, :8].copy().view(">u8")[:, 0].astype(np.int64)
    for channel in range(len(table.channels)):
        of_channel = numbers[table.channel == channel]
        assert np.array_equal(of_channel, np.arange(of_channel.size)), f"{table.channels[channel]}: a gap"
    return len(table)


def start(*words: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True)


def round_of(
    folder: Path, suffix: str, seconds: float, rate: float, *, peer: bool
) -> list[tuple[str, float, int, int]]:
    """(recorder, processor time [s], frames sent, frames in the files) of each recorder of one round."""
    paths = [str(folder / f"bus{k}") for k in range(BUSES)]
    hubs = [start("-m", "loaderhil", "hub", "--bus", f"hub:{path}") for path in paths]
    running = []
    try:
        for path in paths:
            # ten interpreters start at once on two processors
            wait_for_hub(path, 60)
        ours = folder / f"ours{suffix}"
        if peer:
            running.append(start("-c", PEER, str(folder), *paths))
            assert running[0].stdout.readline() == "ready\n"
        else:
            running.append(
                start("-m", "loaderhil", "record", *(f"hub:{path}" for path in paths), "--out", str(ours))
            )
            # the file appears when every bus has been opened
            while not ours.exists():
                time.sleep(0.05)
        # imports and the first allocations are over before processor time is counted
        time.sleep(1)
        before = used_s(running[0])
        generator = start("-c", GENERATOR, str(rate), str(seconds), *paths)
        sent, _ = map(int, generator.communicate()[0].split())
        spent = settled_s(running[0]) - before
        running[0].send_signal(signal.SIGTERM if peer else signal.SIGINT)
        running[0].communicate()
        if peer:
            written = sum(sum(1 for _ in (folder / f"peer{k}.log").open()) for k in range(BUSES))
            return [("python-can Logger (.log)", spent, sent, written)]
        return [(f"loaderhil record ({suffix})", spent, sent, complete(ours))]
    finally:
        for process in (*running, *hubs):
            if process.poll() is None:
                # Ctrl-C, as a user ends them: files are finished and hubs leave no socket behind
                process.send_signal(signal.SIGINT)
                process.communicate()


def main() -> int:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    rate = float(sys.argv[2]) if len(sys.argv) > 2 else 40_000.0
    print(
        f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}, {BUSES} buses, {rate:.0f} frames/s for {seconds:g} s\n"
    )
    print("| recorder | frames sent | in the file | lost | processor time per frame | share of a processor |")
    print("|---|---|---|---|---|---|")
    costs = {}
    for suffix, peer in (*((suffix, False) for suffix in FORMATS), (".log", True)):
        with tempfile.TemporaryDirectory(prefix="bench") as folder:
            for name, spent, sent, written in round_of(Path(folder), suffix, seconds, rate, peer=peer):
                costs[name] = spent / max(written, 1)
                print(
                    f"| {name} | {sent} | {written} | {sent - written} | {1e6 * costs[name]:.2f} µs | {100 * spent / seconds:.0f} % |",
                    flush=True,
                )
    ours = costs["loaderhil record (.log)"]
    print(
        f"\nper frame recorded: {costs['python-can Logger (.log)'] / ours:.1f}x less than python-can's Logger"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
