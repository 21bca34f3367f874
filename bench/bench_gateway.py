"""Benchmark of the gateway: `python -m bench.bench_gateway [--seconds N]`.

40 000 frames/s, as many as ten full 500 kbit/s buses carry, from one hub through a relay to another hub, each a
process. The frames are those of loader.dbc in turn, with running counters and valid CRCs, in bursts of 40 each
millisecond. Arms, in one run:
  raw relay  a process that does nothing but recv and send on the sockets of the two hubs: the floor
  gateway    `loaderhil gateway`, with routes, stamps, counters and the end-to-end check of every frame
The latency is that from sending on the one hub to the second hub's stamp: two relays and one way between. What the
gateway adds is the difference of the two arms. On a machine that others use, run it as
`chrt -r 1 python -m bench.bench_gateway`: a process that waits half a second for a processor is 20 000 frames behind.
The relay's resident memory is printed after a tenth of the time and at the end.
"""

import argparse
import multiprocessing
import os
import platform
import select
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import cycle, islice
from pathlib import Path

import numpy as np

from bus.frame import Frame
from bus.hub import packet
from bus.hub.client import HubTransport, hub_status
from bus.hub.server import Hub
from bus.ticks import Ticks
from dbc import loader_database
from dbc.protection import Protector
from hil.faults.control import ask

RATE = 40_000
TICK_NS = 1_000_000
BURST = RATE * TICK_NS // 1_000_000_000
# The relay's start-up (imports, first allocations) must not fall into the measured time.
SETTLE_S = 1.0
PAUSE_S = 0.002
QUIET_MS, START_MS = 5_000, 60_000
"""Silence after which the receiver ends [ms]: after the first frame, and while it waits for the first."""
SLICES = 6
"""Parts of the measured time whose percentiles give the spread."""
FORK = multiprocessing.get_context("fork")


def frames_in_turn() -> list[Frame]:
    """The machine's messages in turn, until every counter is back at its first value."""
    codecs = [c for c in loader_database().by_name.values() if c.senders == ("Machine",)]
    protectors = {c.name: Protector(c) for c in codecs if c.e2e_data_id is not None}
    frames = []
    # 15 turns: alive counters run from 0 to 14 (E2E profile 1), so that the sequence can be repeated without a jump
    for turn in range(15):
        for codec in codecs:
            data = bytes([0, 0, *([turn] * (codec.length - 2))])
            protector = protectors.get(codec.name)
            frames.append(Frame(codec.can_id, protector.protect(data) if protector else data))
    return frames


def serve_hub(path: str) -> None:
    # Ctrl-C goes to the whole group: the hub has to outlive what is on it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Hub(path) as hub:
        signal.signal(signal.SIGTERM, lambda *_: hub.stop())
        hub.run()


def relay_raw(source: str, sink: str) -> None:
    """Pass records from one hub to another without decoding them."""
    with HubTransport(source, name="relay") as near, HubTransport(sink, name="relay") as far:
        # the transports only say hello; then their sockets are used bare
        receiver = socket.socket(fileno=os.dup(near.fileno()))
        sender = socket.socket(fileno=os.dup(far.fileno()))
        receiver.setblocking(True)
        sender.setblocking(True)
        # many records at once, as the transport reads: the floor is a good relay, not a bad one
        while records := receiver.recv(64 * packet.SIZE):
            sender.sendall(records)


def receive(path: str, file: Path, count: int) -> None:
    """The second hub's stamps of what arrives, until nothing more does, and how many frames it lost for us."""
    stamps = np.zeros(count, np.int64)
    n = 0
    with HubTransport(path, name="sink") as bus:
        poll = select.poll()
        poll.register(bus.fileno(), select.POLLIN)
        # ended by silence: a lost frame must not hang the benchmark
        while n < count and poll.poll(QUIET_MS if n else START_MS):
            for frame in bus.drain(1024):
                stamps[n] = frame.at_ns
                n += 1
            # so that it reads in batches: the receiver is not measured and should use little processor time
            time.sleep(PAUSE_S)
        lost = bus.statistics().dropped_in
    np.savez(file, stamps=stamps[:n], lost=lost)


def send(path: str, count: int) -> np.ndarray:
    """Send `count` frames, a burst each millisecond; returns the time at which each was handed over [ns]."""
    stamps = np.zeros(count, np.int64)
    frames = cycle(frames_in_turn())
    n = 0
    with HubTransport(path, name="source") as bus, Ticks(TICK_NS) as ticks:
        os.set_blocking(ticks.fileno(), True)
        while n < count:
            # after a missed tick two bursts at once, so that the mean rate holds
            due = min(BURST * ticks.expired(), count - n)
            for frame in islice(frames, due):
                # before it is handed over: a refusal counts as latency
                stamps[n] = time.monotonic_ns()
                # a refused frame is offered again: a lost one would make it unknown which frame is which
                while not bus.send(frame):
                    time.sleep(0.0001)
                n += 1
    return stamps


def resident_mib(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / (1 << 20)


def processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(arm: str, folder: Path, seconds: float) -> dict[str, object]:
    """One arm: latencies [us] per slice, frames lost, memory, processor time per frame [us]."""
    source, sink, control = (str(folder / f"{arm[:3]}-{name}") for name in ("a", "b", "control"))
    hubs = [FORK.Process(target=serve_hub, args=(path,), daemon=True) for path in (source, sink)]
    for hub in hubs:
        hub.start()
    while not all(Path(path).exists() for path in (source, sink)):
        time.sleep(0.01)
    count = int(seconds * RATE)
    receiver = FORK.Process(target=receive, args=(sink, folder / "stamps.npz", count), daemon=True)
    receiver.start()
    if arm == "gateway":
        words = ["--plant-bus", f"hub:{source}", "--ecu-bus", f"hub:{sink}", "--control", control]
        relay = subprocess.Popen(
            [sys.executable, "-m", "loaderhil", "gateway", *words], stderr=subprocess.DEVNULL
        )
        end = relay.wait
    else:
        process = FORK.Process(target=relay_raw, args=(source, sink), daemon=True)
        process.start()
        relay, end = process, process.join
    # the hubs know when everybody has joined; a fixed wait would be too short or too long
    while not (hub_status(source).clients and len(hub_status(sink).clients) == 2):
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    results: list[np.ndarray] = []
    memory: list[float] = []
    before_s = processor_s(relay.pid)
    parent, child = FORK.Pipe(duplex=False)
    # a process of its own: the sender's 40 000 calls a second must not share an interpreter with this one
    sender = FORK.Process(target=lambda: child.send(send(source, count)), daemon=True)
    sender.start()
    # after a tenth every buffer has been filled once; memory that grows later is a leak
    time.sleep(seconds / 10)
    memory.append(resident_mib(relay.pid))
    results.append(parent.recv())
    receiver.join()
    memory.append(resident_mib(relay.pid))
    used_s = processor_s(relay.pid) - before_s
    figures = ask(Path(control), {"command": "status"})["figures"] if arm == "gateway" else {}
    hub_lost = sum(client.dropped for path in (source, sink) for client in hub_status(path).clients)
    relay.terminate()
    end()
    for hub in hubs:
        hub.terminate()
    with np.load(folder / "stamps.npz") as archive:
        arrived, lost = archive["stamps"], int(archive["lost"])
    sent = results[0]
    late = (arrived - sent[: arrived.size]) * 1e-3
    if arrived.size < count:  # which frame is which is unknown once one is missing
        late = np.full(SLICES, np.nan)
    return {
        # percentiles by slice of time: their spread shows whether the tail is one moment or the rule
        "slices": [np.percentile(part, (50, 99)) for part in np.array_split(late, SLICES)],
        "rate": count / ((sent[-1] - sent[0]) * 1e-9),
        "missing": count - arrived.size,
        "lost": max(lost, hub_lost),
        "memory": memory,
        "cpu": used_s / count * 1e6,
        "figures": figures,
    }


def cell(values: list[float]) -> str:
    return f"{statistics.median(values):.0f} ({min(values):.0f}..{max(values):.0f})"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument(
        "--seconds", type=float, default=60.0, help="of the gateway's arm; a third for the floor"
    )
    chosen = arguments.parse_args()
    print(f"Python {platform.python_version()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}\n")
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        arms = {
            "raw relay": measure("raw relay", Path(folder), chosen.seconds / 3),
            "gateway": measure("gateway", Path(folder), chosen.seconds),
        }
    print(
        "| through | frames/s | s | not arrived | p50 [us] | p99 [us] | CPU of the relay [us/frame] | resident [MiB] |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, seen in arms.items():
        seconds = chosen.seconds if name == "gateway" else chosen.seconds / 3
        p50, p99 = ([float(part[k]) for part in seen["slices"]] for k in (0, 1))
        memory = " -> ".join(f"{value:.1f}" for value in seen["memory"])
        print(
            f"| {name} | {seen['rate']:.0f} | {seconds:.0f} | {seen['missing']} | {cell(p50)} | {cell(p99)} "
            f"| {seen['cpu']:.1f} | {memory} |"
        )
    added = [
        statistics.median(float(part[k]) for part in arms["gateway"]["slices"])
        - statistics.median(float(part[k]) for part in arms["raw relay"]["slices"])
        for k in (0, 1)
    ]
    print(f"\nThe gateway adds {added[0]:.0f} us at p50 and {added[1]:.0f} us at p99 to the raw relay.")
    print(f"What the gateway counted: {arms['gateway']['figures']}")


if __name__ == "__main__":
    main()
