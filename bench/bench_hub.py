"""Benchmark of the hub under load: `python -m bench.bench_hub [--rate FRAMES] [--seconds S] [--rounds N]`.

One client sends `rate` frames a second in a burst every millisecond; two others read them all and check
that none is missing or out of order. 40 000 frames/s are ten full buses of 500 kbit/s. CPU time is that of
the hub per frame taken, in each round after that of a process that only moves the bytes from one socket to
two others: the floor of any hub in this language. Memory of the hub is looked at every second; its first
seconds do not count, in which buffers are made.
"""

import argparse
import os
import platform
import select
import socket
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from bench.bench_bus import in_process, serve
from bus.frame import Frame
from bus.hub import packet
from bus.hub.client import HubTransport, hub_status
from bus.ticks import Ticks

PACE_NS = 1_000_000
# The least bus that has to copy: one frame in, two out.
READERS = 2
SETTLE_S = 5
TICK_S = 1 / os.sysconf("SC_CLK_TCK")
PAGE_KIB = os.sysconf("SC_PAGE_SIZE") // 1024


@dataclass(frozen=True)
class Load:
    """The result of one run."""

    sent: int  # frames
    lost: int  # frames
    disordered: int  # frames out of order
    cpu_s: float  # of the process in the middle
    memory_kib: list[int]  # of that process, every second

    @property
    def cpu_us(self) -> float:
        """CPU time per frame taken [us]."""
        return self.cpu_s / self.sent * 1e6

    @property
    def growth_kib(self) -> int:
        """How much the memory rose after the start; 0 if the run was too short to say."""
        # one value per second, so that an index is a time
        settled = self.memory_kib[SETTLE_S:]
        return max(settled) - settled[0] if settled else 0


def cpu_s(pid: int) -> float:
    """Processor time that a process has used so far."""
    # after the last bracket: the name of a process may hold spaces and brackets (proc(5))
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def memory_kib(pid: int) -> int:
    """Resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_KIB


def read_hub(pipe: Connection, path: str) -> None:
    """Count frames and gaps in their numbers, until one without a number."""
    count = disordered = 0
    with HubTransport(path) as transport:
        poll = select.poll()
        poll.register(transport.fileno(), select.POLLIN)
        pipe.send("ready")
        while True:
            poll.poll()
            for frame in transport.drain():
                if not frame.data:
                    pipe.send((count, disordered))
                    return
                # against the count, not against the number before: after one lost frame every later one is out of
                # order
                disordered += int.from_bytes(frame.data, "little") != count
                count += 1


def read_bytes(pipe: Connection, end: socket.socket) -> None:
    """Count records until the other end is closed."""
    size = 0
    pipe.send("ready")
    while data := end.recv(64 * packet.SIZE):
        size += len(data)
    pipe.send((size // packet.SIZE, 0))


def move_bytes(pipe: Connection, source: socket.socket, sinks: list[socket.socket]) -> None:
    """Copy all received bytes to every sink."""
    buffer = bytearray(64 * packet.SIZE)
    view = memoryview(buffer)
    pipe.send("ready")
    while size := source.recv_into(buffer):
        for sink in sinks:
            sink.sendall(view[:size])


def paced(send: Callable[[Frame], object], rate: int, seconds: float, each_second: Callable[[], None]) -> int:
    """Send numbered frames at the given rate; a late burst is larger, so that the mean rate holds. Returns their number."""
    per_tick, ticks_planned = rate * PACE_NS // 1_000_000_000, round(seconds * 1e9 / PACE_NS)
    number = passed = 0
    with Ticks(PACE_NS) as ticks:
        os.set_blocking(ticks.fileno(), True)
        while passed < ticks_planned:
            expired = ticks.expired()
            if (passed + expired) * PACE_NS // 1_000_000_000 > passed * PACE_NS // 1_000_000_000:
                each_second()
            passed += expired
            # up to where the rate should be: a late tick sends the missed ones as well
            while number < min(passed, ticks_planned) * per_tick:
                send(Frame(0x100, number.to_bytes(8, "little")))
                number += 1
    return number


def load_hub(rate: int, seconds: float) -> Load:
    """The hub between a sender and its readers."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "hub")
        hub, ready = in_process(serve, path)
        ready.recv()
        readers = [in_process(read_hub, path) for _ in range(READERS)]
        for _, pipe in readers:
            pipe.recv()
        memory: list[int] = []
        with HubTransport(path) as transport:
            before_s = cpu_s(hub.pid or 0)
            sent = paced(transport.send, rate, seconds, lambda: memory.append(memory_kib(hub.pid or 0)))
            # refused by a full queue: lost as well, but on the sender's side
            refused = transport.statistics().dropped_out
            # the hub's own count: processor time is read when it has taken everything
            while hub_status(path).clients[-1].sent < sent - refused:
                time.sleep(0.01)
            used_s = cpu_s(hub.pid or 0) - before_s
            # a frame without a number ends the readers; it must not be lost, hence the repeats
            while not transport.send(Frame(0x100, b"")):
                time.sleep(0.01)
            results = [pipe.recv() for _, pipe in readers]
        for process, _ in readers:
            process.join()
        hub.terminate()
        hub.join()
    lost = refused + sum(sent - refused - count for count, _ in results)
    return Load(sent, lost, sum(gaps for _, gaps in results), used_s, memory)


def load_floor(rate: int, seconds: float) -> Load:
    """The floor: a process that only copies bytes."""
    near, middle = socket.socketpair()
    pairs = [socket.socketpair() for _ in range(READERS)]
    mover, ready = in_process(move_bytes_alone, near, middle, pairs)
    ready.recv()
    readers = [in_process(read_bytes_alone, near, middle, pairs, number) for number in range(READERS)]
    for _, pipe in readers:
        pipe.recv()
    # a copy here would keep the sockets open, and the readers would wait for ever
    for end in (middle, *(end for pair in pairs for end in pair)):
        end.close()
    memory: list[int] = []
    before_s = cpu_s(mover.pid or 0)
    sent = paced(lambda frame: near.sendall(packet.pack(frame)), rate, seconds, lambda: None)
    # what is still in the sockets belongs to the measured work
    time.sleep(0.2)
    used_s = cpu_s(mover.pid or 0) - before_s
    near.close()
    counts = [pipe.recv()[0] for _, pipe in readers]
    for process in (mover, *(process for process, _ in readers)):
        process.join()
    return Load(sent, sum(sent - count for count in counts), 0, used_s, memory)


Pairs = list[tuple[socket.socket, socket.socket]]


def move_bytes_alone(pipe: Connection, near: socket.socket, middle: socket.socket, pairs: Pairs) -> None:
    """`move_bytes` with no other end held open."""
    near.close()
    for _, far in pairs:
        far.close()
    move_bytes(pipe, middle, [onward for onward, _ in pairs])


def read_bytes_alone(
    pipe: Connection, near: socket.socket, middle: socket.socket, pairs: Pairs, mine: int
) -> None:
    """`read_bytes` with no other end held open."""
    near.close()
    middle.close()
    for number, (onward, far) in enumerate(pairs):
        onward.close()
        if number != mine:
            far.close()
    read_bytes(pipe, pairs[mine][1])


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--rate", type=int, default=40_000, help="frames per second")
    arguments.add_argument("--seconds", type=float, default=60.0, help="of the long run")
    arguments.add_argument("--rounds", type=int, default=5, help="of 4 s, hub against bytes moved")
    chosen = arguments.parse_args()
    print(
        f"{platform.machine()}, {os.cpu_count()} CPUs, Linux {platform.release()}, Python {platform.python_version()}; "
        f"{chosen.rate} frames/s, {READERS} readers\n"
    )
    long = load_hub(chosen.rate, chosen.seconds)
    print("| hub, long run | |\n|---|---|")
    print(f"| frames sent in {chosen.seconds:g} s | {long.sent} |")
    print(f"| lost, out of order | {long.lost}, {long.disordered} |")
    print(
        f"| CPU of the hub | {100 * long.cpu_s / chosen.seconds:.0f} % of one, {long.cpu_us:.2f} us/frame |"
    )
    print(
        f"| memory, growth after {SETTLE_S} s | {long.memory_kib[-1] / 1024:.1f} MiB, {long.growth_kib} KiB |"
    )
    hub, floor = [], []
    for _ in range(chosen.rounds):
        # floor and hub in turn, in every round: both see the same load
        floor.append(load_floor(chosen.rate, 4).cpu_us)
        hub.append(load_hub(chosen.rate, 4).cpu_us)
    print("\n| CPU of the middle | us/frame | range | x floor |\n|---|---|---|---|")
    for name, values in (("bytes moved", floor), ("hub", hub)):
        middle = statistics.median(values)
        print(
            f"| {name} | {middle:.2f} | {min(values):.2f}..{max(values):.2f} "
            f"| {middle / statistics.median(floor):.2f} |"
        )


if __name__ == "__main__":
    main()
