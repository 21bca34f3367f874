"""Reading and writing recordings against python-can: processor time per frame, the figures behind docs/adr/0013.

    python -m bench.bench_files

Reading: `dbc.recordings` turns a candump log into arrays, `can.CanutilsLogReader` into one object per frame.
Writing: batches of 400 frames, as the recorder gets them every 10 ms from ten full buses; python-can's writers get
the same frames one by one. Arms are interleaved; medians over rounds, ratios from the pairs of each round.
python-can's MF4 writer holds all frames until it is closed, so its time includes closing; ours is whole after every batch.
"""

import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import can
import numpy as np

from bus.frame import EXTENDED, Frame
from dbc.recordings.reading import read_frames
from hil.recording.formats import open_writer
from hil.recording.ring import Records, records_of

FRAMES = 20_000
BATCH = 400
ROUNDS = 5
SUFFIXES = (".log", ".blf", ".mf4")
PERIOD_NS = 250_000  # 4000 frames/s, a full bus of 500 kbit/s
START_NS = 1_795_000_000_000_000_000  # a wall clock of 2026: BLF and MF4 store dates


def frames_of_a_bus(count: int) -> list[Frame]:
    """Frames of 8 random bytes under 20 extended identifiers, evenly spaced."""
    rng = np.random.default_rng(1)
    # random bytes: BLF and MF4 compress, and zeros would cost nothing
    content = rng.integers(0, 256, (count, 8), np.uint8)
    return [
        Frame(EXTENDED | (0x18FF0000 + i % 20), content[i].tobytes(), at_ns=START_NS + i * PERIOD_NS)
        for i in range(count)
    ]


def write_ours(path: Path, batches: list[Records]) -> None:
    """Each batch reaches the kernel before the next one begins."""
    writer = open_writer(path, ["can0"])
    for batch in batches:
        writer.write(batch)
    writer.close()


def write_theirs(path: Path, messages: list[can.Message]) -> None:
    """python-can's writer of the same format."""
    with can.Logger(path) as writer:
        for message in messages:
            writer.on_message_received(message)


def processor_seconds(work: Callable[[int], object], round_: int) -> float:
    """Processor time of one call, which gets the number of its round."""
    # processor time: waiting for the disk belongs to no writer
    start = time.process_time()
    work(round_)
    return time.process_time() - start


def spread(values: Sequence[float]) -> str:
    """Median, least and most of microseconds per frame."""
    return f"{statistics.median(values):8.2f} us/frame ({min(values):.2f} to {max(values):.2f})"


def main() -> int:
    frames = frames_of_a_bus(FRAMES)
    batches = [records_of(frames[i : i + BATCH]) for i in range(0, FRAMES, BATCH)]
    messages = [
        can.Message(
            timestamp=f.at_ns * 1e-9,
            arbitration_id=f.can_id & ~EXTENDED,
            is_extended_id=True,
            data=f.data,
            channel="can0",
        )
        for f in frames
    ]
    print(
        f"{platform.machine()}, Python {platform.python_version()}, python-can {version('python-can')}, n={ROUNDS}"
    )
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "read.log")
        write_ours(log, batches)
        arms: dict[str, tuple[Callable[[int], object], Callable[[int], object]]] = {
            "read .log": (lambda _: read_frames(log), lambda _: sum(1 for _ in can.CanutilsLogReader(log)))
        }
        for suffix in SUFFIXES:
            # a file of its own per round: overwriting truncates, which is cheaper than growing
            arms[f"write {suffix}"] = (
                lambda n, s=suffix: write_ours(Path(folder, f"ours{n}{s}"), batches),
                lambda n, s=suffix: write_theirs(Path(folder, f"theirs{n}{s}"), messages),
            )
        for name, (ours, theirs) in arms.items():
            ours(ROUNDS)  # the first call imports and compiles
            pairs = [(processor_seconds(ours, n), processor_seconds(theirs, n)) for n in range(ROUNDS)]
            own, peer = ([seconds / FRAMES * 1e6 for seconds in times] for times in zip(*pairs, strict=True))
            # from pairs, not from medians: the load of the computer changes between rounds
            ratios = [b / a for a, b in pairs]
            print(
                f"{name:11s} {spread(own)}, python-can {spread(peer).replace(' us/frame', '')}: "
                f"{statistics.median(ratios):.1f}x ({min(ratios):.1f} to {max(ratios):.1f})"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
