"""Decoding a candump log and a BLF of a million frames: ours against python-can + cantools, and asammdf on the same frames.

    python -m bench.bench_decode [FRAMES]

The recordings are made of the bench's own frames. python-can's readers with cantools are timed on a part and
scaled (their cost per frame is constant); asammdf reads an MF4 of the same frames, as it does not read candump
logs. Ours is the path of `loaderhil decode`: every signal of every frame as columns, piece by piece, once dropped and once
written as Parquet. The floors are what no decoder can go below: a copy of the log's bytes in memory, and the inflation of
the BLF's containers on one processor. All in one run, repetitions interleaved; medians, spreads and ratios are printed.
"""

import platform
import statistics
import sys
import tempfile
import time
import zlib
from importlib.metadata import version
from pathlib import Path

import asammdf
import can
import cantools
import numpy as np
from asammdf.blocks import v4_constants
from asammdf.blocks.v4_blocks import SourceInformation

from dbc import FOLDER, loader_database
from dbc.columns import ColumnDecoder
from dbc.offline.decoding import decode_log
from dbc.offline.writing import Tables
from dbc.recordings.logfile import FrameTable, read_candump
from dbc.tables import Format

PART = 50_000
# Each takes seconds; the spread of five is printed beside the median.
REPEATS = 5
LABELS = {
    "copy": "floor: the log's bytes copied in memory",
    "log": "candump log, column decoder",
    "parquet": "candump log to Parquet",
    "peer": "python-can LogReader + cantools",
    "mdf": "asammdf extract_bus_logging (MF4 of the same frames)",
    "inflate": "floor: the BLF's containers inflated by zlib on one processor",
    "blf": "BLF, column decoder",
    "blf peer": "python-can BLFReader + cantools",
}


def make_log(path: Path, frames: int) -> None:
    """Every message of loader.dbc in turn with random payloads, a millisecond apart."""
    rng = np.random.default_rng(1)
    codecs = list(loader_database().by_name.values())
    # one call for all frames: a million calls would take longer than the measurement
    payload = rng.integers(0, 256, (frames, 8), np.uint8).tobytes().hex().upper()
    names = [f"{codec.can_id & 0x1FFFFFFF:08X}" for codec in codecs]
    with path.open("w") as out:
        for i in range(frames):
            out.write(
                f"({i // 1000}.{i % 1000:03d}000) can0 {names[i % len(names)]}#{payload[16 * i : 16 * i + 16]}\n"
            )


def make_mf4(path: Path, table: FrameTable) -> None:
    """The same frames as a bus-logging MF4."""
    count = len(table)
    frame = np.zeros(
        count,
        dtype=[
            ("CAN_DataFrame.BusChannel", "u1"),
            ("CAN_DataFrame.ID", "<u4"),
            ("CAN_DataFrame.IDE", "u1"),
            ("CAN_DataFrame.DLC", "u1"),
            ("CAN_DataFrame.DataLength", "u1"),
            ("CAN_DataFrame.DataBytes", "(8,)u1"),
        ],
    )
    frame["CAN_DataFrame.BusChannel"] = 1
    frame["CAN_DataFrame.ID"] = table.can_id & 0x1FFFFFFF
    frame["CAN_DataFrame.IDE"] = 1
    frame["CAN_DataFrame.DLC"] = frame["CAN_DataFrame.DataLength"] = 8
    frame["CAN_DataFrame.DataBytes"] = table.data[:, :8]
    # a layout that asammdf itself recognises as bus logging (ASAM MDF, CAN_DataFrame)
    mdf = asammdf.MDF(version="4.10")
    source = SourceInformation(source_type=v4_constants.SOURCE_BUS, bus_type=v4_constants.BUS_TYPE_CAN)
    signal = asammdf.Signal(frame, table.time_ns * 1e-9, name="CAN_DataFrame", source=source)
    mdf.append(signal)
    mdf.save(path, overwrite=True)
    mdf.close()


def make_blf(path: Path, table: FrameTable) -> None:
    """The same frames as a BLF of python-can's writer."""
    with can.BLFWriter(path) as writer:
        for frame in table.frames():
            writer.on_message_received(
                can.Message(
                    timestamp=1.6e9 + frame.at_ns * 1e-9, arbitration_id=frame.can_id & 0x1FFFFFFF, data=frame.data, channel=0
                )
            )  # fmt: skip


def ours(recording: Path) -> int:
    cells = 0

    def take(_, decoded) -> None:
        nonlocal cells
        cells += sum(columns.time_s.size * (1 + len(columns.signals)) for columns in decoded.values())

    decode_log(recording, ColumnDecoder(loader_database()), take=take)
    return cells


def written(recording: Path) -> int:
    with (
        tempfile.TemporaryDirectory() as out,
        Tables(Path(out), recording, Format.PARQUET, several=False, j1939=False) as tables,
    ):
        done = decode_log(recording, ColumnDecoder(loader_database()), take=tables.take)
        tables.finish()
    return done.frames


def copied(recording: bytes) -> int:
    return len(bytearray(recording))


def inflated(bodies: list[bytes]) -> int:
    return sum(len(zlib.decompress(body)) for body in bodies)


def bodies_of(blf: bytes) -> list[bytes]:
    """The deflated bytes of each container (python-can's writer puts all objects into containers)."""
    found, at = [], 144
    while at < len(blf):
        length = int.from_bytes(blf[at + 8 : at + 12], "little")
        found.append(blf[at + 32 : at + length])
        at += length + length % 4
    return found


def peer(recording: Path) -> int:
    database = cantools.database.load_file(FOLDER / "loader.dbc")
    count = 0
    with can.LogReader(recording) as reader:
        for message in reader:
            database.decode_message(message.arbitration_id, message.data, decode_choices=False)
            count += 1
    return count


def mdf(path: Path) -> int:
    with asammdf.MDF(path) as recording:
        decoded = recording.extract_bus_logging({"CAN": [(FOLDER / "loader.dbc", 0)]})
        groups = len(decoded.groups)
        decoded.close()
    return groups


def seconds(work, *arguments) -> float:
    start = time.perf_counter()
    # a reader that gives nothing would win
    assert work(*arguments)
    return time.perf_counter() - start


def main() -> int:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "numba", "python-can", "cantools", "asammdf"))
    print(
        f"{platform.machine()}, {platform.processor() or 'unknown processor'}, Python {platform.python_version()}, {packages}"
    )
    times: dict[str, list[float]] = {name: [] for name in LABELS}
    with tempfile.TemporaryDirectory() as folder:
        log, part, recording, blf, blf_part = (
            Path(folder) / name for name in ("all.log", "part.log", "all.mf4", "all.blf", "part.blf")
        )
        make_log(log, frames)
        make_log(part, min(PART, frames))
        make_mf4(recording, read_candump(log))
        make_blf(blf, read_candump(log))
        make_blf(blf_part, read_candump(part))
        content, bodies = log.read_bytes(), bodies_of(blf.read_bytes())
        scale = frames / min(PART, frames)
        # compile
        for work in (ours, written):
            for file in (part, blf_part):
                work(file)
        for _ in range(REPEATS):
            times["copy"].append(seconds(copied, content))
            times["log"].append(seconds(ours, log))
            times["parquet"].append(seconds(written, log))
            # a part, scaled: the whole log would take python-can and cantools minutes in every repeat
            times["peer"].append(seconds(peer, part) * scale)
            times["mdf"].append(seconds(mdf, recording))
            times["inflate"].append(seconds(inflated, bodies))
            times["blf"].append(seconds(ours, blf))
            times["blf peer"].append(seconds(peer, blf_part) * scale)
    middle = {name: statistics.median(t) for name, t in times.items()}
    for name, label in LABELS.items():
        t = times[name]
        print(f"{middle[name]:8.3f} s  ({min(t):.3f} to {max(t):.3f}, n={len(t)})  {label}")
    for name in ("log", "parquet", "blf"):
        print(f"{LABELS[name]}: {frames / middle[name] / 1e6:.2f} million frames/s")
    for ours_name, others in (("log", ("peer", "mdf", "copy")), ("blf", ("blf peer", "inflate"))):
        for other in others:
            # of the same repeat, so that a busy moment slows both
            ratios = [theirs / own for theirs, own in zip(times[other], times[ours_name], strict=True)]
            print(
                f"{LABELS[other]} / {LABELS[ours_name]}: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
