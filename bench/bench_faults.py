"""Cost of a fault injector: per frame that passes it, and per tick of a lockstep run's wire.

    python -m bench.bench_faults

The floor is a function that only wraps the frame; the peer of the faulty wire is the plain one, with the same frames.
"""

import platform
import statistics
import sys
import time

from bus.frame import Frame
from bus.wire import Wire
from configuration import CheckedTable
from dbc import loader_database
from hil.faults.injector import Injector
from hil.faults.passage import Planned
from hil.faults.table import read_fault
from hil.faults.wire import FaultyWire

ROUNDS, FRAMES, TICKS = 7, 40_000, 1_000
PERIOD_NS = 10_000_000
# A fault that never matches: what a bench pays for having the injector at all.
OTHERS = [{"kind": "drop", "message": "Limits"}]
# One of each way to treat a frame: away, later, other content, other content with a right CRC, random time.
FIVE = [
    {"kind": "drop", "message": "WheelSpeeds", "probability": 0.1},
    {"kind": "delay", "message": "BodyRates", "delay_ms": 5.0},
    {"kind": "freeze", "message": "BodyAcceleration", "signal": "Lateral"},
    {"kind": "corrupt", "message": "Articulation", "probability": 0.1, "valid_crc": True},
    {"kind": "jitter", "message": "LinkageAngles", "jitter_ms": 5.0},
]
DATABASE = loader_database()
MACHINE = [codec for codec in DATABASE.by_name.values() if "Machine" in codec.senders]


def injector(tables):
    made = Injector(DATABASE, [read_fault(CheckedTable(t, file="bench"), DATABASE) for t in tables])
    made.start(0)
    return made


def wrap(side, frame, now_ns):
    return (Planned(now_ns, frame),)


def per_frame_us(pass_frame):
    frames = [Frame(codec.can_id, bytes(codec.length)) for codec in MACHINE]
    start = time.perf_counter_ns()
    # messages in turn, as on the bus: a single identifier would stay in every cache
    for n in range(FRAMES // len(frames)):
        for frame in frames:
            pass_frame("plant", frame, n * PERIOD_NS)
    return (time.perf_counter_ns() - start) * 1e-3 / (FRAMES // len(frames) * len(frames))


def per_tick_us(wire):
    frames = [Frame(codec.can_id, bytes(codec.length)) for codec in MACHINE]
    start = time.perf_counter_ns()
    for n in range(TICKS):
        wire.put(frames, n * PERIOD_NS, "plant")
        wire.take((n + 1) * PERIOD_NS)
    return (time.perf_counter_ns() - start) * 1e-3 / TICKS


def rows(cases, measure):
    """Measure every case in every round, so that a slow moment of the machine affects all cases alike; print the rows."""
    found = {name: [] for name in cases}
    for _ in range(ROUNDS):
        for name, make in cases.items():
            # made anew: an injector keeps random states and queues
            found[name].append(measure(make()))
    floor = statistics.median(next(iter(found.values())))
    for name, times in found.items():
        median = statistics.median(times)
        print(f"| {name} | {median:.2f} | {min(times):.2f} … {max(times):.2f} | {median / floor:.1f} |")


def main() -> int:
    print(f"{platform.machine()}, Python {platform.python_version()}, {ROUNDS} rounds\n")
    print("| per frame | median [us] | spread | against the floor |\n|---|---:|---:|---:|")
    rows(
        {
            "a function that wraps the frame (floor)": lambda: wrap,
            "no fault": lambda: injector([]).pass_frame,
            "one fault on another message": lambda: injector(OTHERS).pass_frame,
            "five faults, on most of the messages": lambda: injector(FIVE).pass_frame,
        },
        per_frame_us,
    )
    print(
        f"\n| per tick of {len(MACHINE)} frames | median [us] | spread | against the plain wire |\n|---|---:|---:|---:|"
    )
    rows(
        {
            "plain wire": Wire,
            "faulty wire, no fault": lambda: FaultyWire(injector([])),
            "faulty wire, five faults": lambda: FaultyWire(injector(FIVE)),
        },
        per_tick_us,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
