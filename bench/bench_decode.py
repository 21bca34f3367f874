"""Decoding a candump log of a million frames: ours against python-can + cantools, and asammdf on the same frames.

    python bench/bench_decode.py [FRAMES]

The log is made of the bench's own frames. python-can's reader with cantools is timed on a part of it and
scaled (its cost per frame is constant); asammdf reads an MF4 of the same frames, as it does not read candump
logs. All in one run, repetitions interleaved; medians and ratios are printed.
"""

import platform
import statistics
import sys
import tempfile
import time
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
from dbc.recordings.logfile import FrameTable, read_candump

PART = 50_000
# Each takes seconds; the spread of five is printed beside the median.
REPEATS = 5


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


def ours(log: Path) -> int:
    columns = ColumnDecoder(loader_database()).decode(read_candump(log))
    return sum(c.time_s.size for c in columns.values())


def peer(log: Path) -> int:
    database = cantools.database.load_file(FOLDER / "loader.dbc")
    count = 0
    with can.LogReader(log) as reader:
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
    with tempfile.TemporaryDirectory() as folder:
        log, part, recording = (Path(folder) / name for name in ("all.log", "part.log", "all.mf4"))
        make_log(log, frames)
        make_log(part, min(PART, frames))
        make_mf4(recording, read_candump(log))
        ours(part)  # compile
        times: dict[str, list[float]] = {"ours": [], "peer": [], "mdf": []}
        for _ in range(REPEATS):
            times["ours"].append(seconds(ours, log))
            # a part, scaled: the whole log would take python-can and cantools minutes in every repeat
            times["peer"].append(seconds(peer, part) * frames / min(PART, frames))
            times["mdf"].append(seconds(mdf, recording))
    for name, label in (
        ("ours", "candump log, column decoder"),
        ("peer", f"python-can LogReader + cantools (on {min(PART, frames)} frames, scaled)"),
        ("mdf", "asammdf extract_bus_logging (MF4 of the same frames)"),
    ):
        t = times[name]
        print(f"{statistics.median(t):8.3f} s  ({min(t):.3f} to {max(t):.3f}, n={len(t)})  {label}")
    middle = {name: statistics.median(t) for name, t in times.items()}
    print(
        f"{frames} frames: {middle['peer'] / middle['ours']:.0f}x python-can + cantools, {middle['mdf'] / middle['ours']:.1f}x asammdf"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
