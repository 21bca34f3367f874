"""Benchmark of the hub and of the receive path: `python -m bench.bench_bus [--frames N] [--rounds N]`.

Latency, one way, sender and receiver in two processes, one frame per millisecond:
  direct     one Unix stream socket between them, 84 bytes as the hub uses: the floor of one hop
  raw relay  a third process that does nothing but recv and send: the floor of any relay, two hops
  hub        HubTransport, hub process, HubTransport: packing, stamping, unpacking included
  python-can HubBus on the same hub, as a user of python-can sees it

Receive path, CPU time of the receiving process per frame, frames of loader.dbc in bursts of 16 every 4 ms:
  ours       asyncio as plant and ECU read (bus.pacing.reading), HubTransport.drain, generated codec
  python-can Notifier and AsyncBufferedReader on HubBus, cantools
With CAN in the kernel (vcan0) the receive path is measured on SocketCAN too, there with python-can's own interface.
Every arm runs in every round, so that a busy machine is busy for all; ratios are those of the medians over the
rounds, with the range of the ratios within a round.
"""

import argparse
import asyncio
import multiprocessing
import os
import platform
import select
import socket
import statistics
import struct
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path

import can
import cantools

import dbc
from bus.address import open_transport
from bus.frame import Frame
from bus.hub import packet
from bus.hub.client import HubTransport
from bus.hub.server import Hub
from bus.pacing import reading
from bus.python_can import HubBus
from bus.socketcan.link import can_interfaces
from bus.ticks import Ticks

STAMP = struct.Struct("=q")
# Slow enough that no frame waits for another: latency, not throughput.
PACE_NS = 1_000_000
# 16 frames every 4 ms: 4000 frames/s, a full bus of 500 kbit/s, in bursts as a machine sends them.
BURST = 16
BURST_NS = 4_000_000
END = 0x7FF
"""Identifier of the frame after the last."""
# fork: the child inherits the sockets of an arm; spawn would have to pass them on
FORK = multiprocessing.get_context("fork")


def in_process(work: Callable[..., object], *arguments: object) -> tuple[multiprocessing.Process, Connection]:
    """Start `work(pipe, *arguments)` in its own process; it sends "ready" and later its result through the pipe."""
    ours, theirs = FORK.Pipe()
    process = FORK.Process(target=work, args=(theirs, *arguments), daemon=True)
    process.start()
    return process, ours


def paced(send: Callable[[bytes], object], frames: int) -> None:
    """Send the time of sending once per millisecond."""
    with Ticks(PACE_NS) as ticks:
        os.set_blocking(ticks.fileno(), True)
        for _ in range(frames):
            ticks.expired()
            # the time of sending is the content of the frame: no second channel between the processes is needed
            send(STAMP.pack(time.monotonic_ns()))


def receive_raw(pipe: Connection, end: socket.socket, frames: int) -> None:
    pipe.send("ready")
    late = []
    for _ in range(frames):
        data = end.recv(packet.SIZE)
        # the monotonic clock is one for all processes of a computer
        late.append(time.monotonic_ns() - STAMP.unpack_from(data)[0])
    pipe.send(late)


def relay_raw(pipe: Connection, source: socket.socket, sink: socket.socket, frames: int) -> None:
    buffer = bytearray(packet.SIZE)
    pipe.send("ready")
    for _ in range(frames):
        source.recv_into(buffer)
        sink.send(buffer)
    pipe.send("done")


def receive_hub(pipe: Connection, path: str, frames: int) -> None:
    late: list[int] = []
    with HubTransport(path) as transport:
        poll = select.poll()
        poll.register(transport.fileno(), select.POLLIN)
        pipe.send("ready")
        while len(late) < frames:
            poll.poll()
            late += [time.monotonic_ns() - STAMP.unpack(frame.data)[0] for frame in transport.drain()]
    pipe.send(late)


def receive_python_can(pipe: Connection, path: str, frames: int) -> None:
    late: list[int] = []
    with HubBus(path) as bus:
        pipe.send("ready")
        while len(late) < frames:
            message = bus.recv()
            if message is not None:
                late.append(time.monotonic_ns() - STAMP.unpack(message.data)[0])
    pipe.send(late)


def latency_direct(path: str, frames: int) -> list[int]:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    with near, far:
        process, pipe = in_process(receive_raw, far, frames)
        pipe.recv()
        paced(lambda data: near.send(data.ljust(packet.SIZE, b"\0")), frames)
        return finish(process, pipe)


def latency_relay(path: str, frames: int) -> list[int]:
    near, middle = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    onward, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    with near, middle, onward, far:
        # the receiver first: the relay must not block on a full socket
        receiver, pipe = in_process(receive_raw, far, frames)
        relay, relay_pipe = in_process(relay_raw, middle, onward, frames)
        pipe.recv(), relay_pipe.recv()
        paced(lambda data: near.send(data.ljust(packet.SIZE, b"\0")), frames)
        relay_pipe.recv()
        relay.join()
        return finish(receiver, pipe)


def latency_hub(path: str, frames: int) -> list[int]:
    process, pipe = in_process(receive_hub, path, frames)
    pipe.recv()
    with HubTransport(path) as transport:
        paced(lambda data: transport.send(Frame(1, data)), frames)
        return finish(process, pipe)


def latency_python_can(path: str, frames: int) -> list[int]:
    process, pipe = in_process(receive_python_can, path, frames)
    pipe.recv()
    with HubBus(path) as bus:
        paced(lambda data: bus.send(can.Message(arbitration_id=1, data=data, is_extended_id=False)), frames)
        return finish(process, pipe)


def finish(process: multiprocessing.Process, pipe: Connection) -> list[int]:
    result = pipe.recv()
    process.join()
    return result


def traffic() -> list[Frame]:
    """One frame of every message of loader.dbc, as its sender encodes it."""
    messages = dbc.loader_database().by_name.values()
    return [Frame(message.can_id, bytes(message.length)) for message in messages]


def receive_ours(pipe: Connection, address: str) -> None:
    async def listen() -> tuple[int, float]:
        done = asyncio.Event()
        codecs = dbc.loader_database().by_id
        count = 0

        def receive() -> None:
            nonlocal count
            for frame in transport.drain():
                if frame.can_id == END:
                    done.set()
                    return
                codecs[frame.can_id].decode(frame.data)
                count += 1

        with open_transport(address) as transport:
            reader = asyncio.create_task(reading(transport.fileno(), receive))
            # lets the reader task register its descriptor before the sender begins
            await asyncio.sleep(0)
            pipe.send("ready")
            before = time.process_time()
            await done.wait()
            used = time.process_time() - before
            reader.cancel()
            return count, used

    pipe.send(asyncio.run(listen()))


def receive_theirs(pipe: Connection, interface: str, channel: str) -> None:
    async def listen() -> tuple[int, float]:
        database = cantools.database.load_file(dbc.FOLDER / "loader.dbc")
        count = 0
        with can.Bus(interface=interface, channel=channel) as bus:
            reader = can.AsyncBufferedReader()
            notifier = can.Notifier(bus, [reader], loop=asyncio.get_running_loop())
            pipe.send("ready")
            before = time.process_time()
            while (message := await reader.get_message()).arbitration_id != END:
                # plain numbers, as ours: names of value tables would cost cantools more
                database.decode_message(message.arbitration_id, message.data, decode_choices=False)
                count += 1
            used = time.process_time() - before
            notifier.stop()
        return count, used

    pipe.send(asyncio.run(listen()))


def cpu_per_frame(address: str, receiver: Callable[..., object], *arguments: object, frames: int) -> float:
    """CPU time of the receiving process per received frame [us]; prints a line if frames were lost."""
    process, pipe = in_process(receiver, *arguments)
    pipe.recv()
    messages = traffic()
    with open_transport(address) as sender, Ticks(BURST_NS) as ticks:
        os.set_blocking(ticks.fileno(), True)
        sent = 0
        while sent < frames:
            ticks.expired()
            for _ in range(BURST):
                sender.send(messages[sent % len(messages)])
                sent += 1
        while not pipe.poll(0.1):  # a receiver that could not keep up may have lost the end as well
            sender.send(Frame(END, b""))
        count, seconds = pipe.recv()
        process.join()
    if count != sent:
        print(f"  {receiver.__name__} on {address.partition(':')[0]}: {sent - count} of {sent} frames lost")
    # per frame received, not sent: a receiver that loses frames must not look cheaper
    return seconds / count * 1e6


def quantiles_us(late_ns: list[int]) -> tuple[float, float]:
    ordered = sorted(late_ns)
    return statistics.median(ordered) / 1e3, ordered[int(0.99 * len(ordered))] / 1e3


def serve(pipe: Connection, path: str) -> None:
    with Hub(path) as hub:
        pipe.send("ready")
        hub.run()


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--frames", type=int, default=500, help="frames per arm and round")
    arguments.add_argument("--rounds", type=int, default=20)
    chosen = arguments.parse_args()
    print(
        f"{platform.machine()}, {os.cpu_count()} CPUs, Linux {platform.release()}, Python {platform.python_version()}, "
        f"python-can {version('python-can')}, cantools {version('cantools')}; "
        f"{chosen.rounds} rounds of {chosen.frames} frames"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "hub")
        hub, pipe = in_process(serve, path)
        pipe.recv()
        try:
            latencies(path, chosen.rounds, chosen.frames)
            # fewer and longer rounds: processor time is counted in ticks of 10 ms
            receive_path(path, max(chosen.rounds // 3, 1), 24 * chosen.frames)
        finally:
            hub.terminate()
            hub.join()


def latencies(path: str, rounds: int, frames: int) -> None:
    arms = {
        "direct": latency_direct,
        "raw relay": latency_relay,
        "hub": latency_hub,
        "python-can": latency_python_can,
    }
    p50: dict[str, list[float]] = {name: [] for name in arms}
    p99: dict[str, list[float]] = {name: [] for name in arms}
    for _ in range(rounds):
        # all arms in every round: a busy moment of the computer hits all of them
        for name, measure in arms.items():
            median, tail = quantiles_us(measure(path, frames))
            p50[name].append(median)
            p99[name].append(tail)
    print("\n| one way | p50 [us] | range | p99 [us] | x direct | x relay |\n|---|---|---|---|---|---|")
    for name in arms:
        print(
            f"| {name} | {spread(p50[name], 1)} | {statistics.median(p99[name]):.0f} "
            f"| {ratio(p50[name], p50['direct'])} | {ratio(p50[name], p50['raw relay'])} |"
        )


def receive_path(path: str, rounds: int, frames: int) -> None:
    buses = {"hub": (f"hub:{path}", "loaderhil", path)}
    # many kernels of virtual machines have no vcan; the hub is measured everywhere
    if "vcan0" in can_interfaces():
        buses["SocketCAN"] = ("socketcan:vcan0", "socketcan", "vcan0")
    print(
        "\n| CPU us/frame | ours | range | python-can | range | python-can/ours |\n|---|---|---|---|---|---|"
    )
    for name, (address, interface, channel) in buses.items():
        ours, theirs = [], []
        for _ in range(rounds):
            ours.append(cpu_per_frame(address, receive_ours, address, frames=frames))
            theirs.append(cpu_per_frame(address, receive_theirs, interface, channel, frames=frames))
        print(f"| {name} | {spread(ours, 2)} | {spread(theirs, 2)} | {ratio(theirs, ours)} |")


def spread(values: list[float], digits: int) -> str:
    """Median and range, as two cells."""
    return f"{statistics.median(values):.{digits}f} | {min(values):.{digits}f}..{max(values):.{digits}f}"


def ratio(values: list[float], floor: list[float]) -> str:
    """Ratio of the medians, with the range of the ratios within a round."""
    rounds = [value / low for value, low in zip(values, floor, strict=True)]
    return (
        f"{statistics.median(values) / statistics.median(floor):.2f} ({min(rounds):.2f}..{max(rounds):.2f})"
    )


if __name__ == "__main__":
    main()
