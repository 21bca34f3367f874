"""Checking a candump log: `loaderhil check` against decoding alone, and against python-can, cantools and e2e frame by frame.

    python -m bench.bench_check [FRAMES]

The log holds every cyclic message of loader.dbc at its cycle time, with right counters and CRCs, and values within their
ranges. Decoding alone is the path of `loaderhil decode` without writing tables. The peer reads with python-can, decodes with
cantools, checks profile 1 with the e2e package and takes the gap to the frame before; timed on a part and scaled. All in one run,
repetitions interleaved. The memory is the most that a process of its own takes, for the log and for one of a quarter.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import can
import cantools
from e2e.p01 import E2E_P01_DATAID_BOTH, e2e_p01_check

from bench.bench_decode import ours as decode
from bench.bench_decode import seconds
from dbc import FOLDER, loader_database
from dbc.protection import Protector
from hil.check.observed import check_observed, observed

PART = 50_000
REPEATS = 5
LABELS = {
    "check": "check",
    "decode": "column decoder alone",
    "peer": "python-can LogReader + cantools + e2e",
}
_MS = 1_000_000


def make_log(path: Path, frames: int) -> None:
    """Each cyclic message at its cycle time; payloads of zeros, or of start values."""
    codecs = [codec for codec in loader_database().by_name.values() if codec.cycle_ns]
    protectors = {codec: Protector(codec) for codec in codecs if codec.protection is not None}
    written = now_ns = 0
    with path.open("w") as out:
        while written < frames:
            for codec in codecs:
                if now_ns % codec.cycle_ns:
                    continue
                data = bytes(codec.length)
                if codec in protectors:
                    data = protectors[codec].protect(data)
                at = f"{now_ns // 10**9}.{now_ns // 1000 % 10**6:06d}"
                out.write(f"({at}) can0 {codec.can_id & 0x1FFFFFFF:08X}#{data.hex().upper()}\n")
                written += 1
            now_ns += 10 * _MS


def check(log: Path) -> int:
    done = check_observed(observed(log), [loader_database()])
    return sum(one.verdict.frames for one in done.messages)


def peer(log: Path) -> int:
    database = cantools.database.load_file(FOLDER / "loader.dbc")
    ids = {codec.can_id & 0x1FFFFFFF: codec.e2e_data_id for codec in loader_database().by_name.values()}
    last: dict[int, float] = {}
    late = wrong = 0
    with can.LogReader(log) as reader:
        for message in reader:
            word = message.arbitration_id
            database.decode_message(word, message.data, decode_choices=False)
            if ids[word] is not None:
                wrong += not e2e_p01_check(message.data, ids[word], data_id_mode=E2E_P01_DATAID_BOTH)
            cycle = database.get_message_by_frame_id(word).cycle_time
            late += message.timestamp - last.get(word, message.timestamp) > 1.5e-3 * cycle
            last[word] = message.timestamp
    return len(last) + late + wrong


def memory_mib(log: Path) -> float:
    """The most that `loaderhil check` takes."""
    child = subprocess.Popen(
        [sys.executable, "-m", "loaderhil", "check", str(log)], stdout=subprocess.DEVNULL
    )
    _, _, usage = os.wait4(child.pid, 0)
    return usage.ru_maxrss / 1024


def main() -> int:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "numba", "python-can", "cantools"))
    print(f"{platform.machine()}, Python {platform.python_version()}, {packages}; {frames} frames")
    times: dict[str, list[float]] = {name: [] for name in LABELS}
    with tempfile.TemporaryDirectory() as folder:
        log, quarter, part = (Path(folder, name) for name in ("all.log", "quarter.log", "part.log"))
        for file, count in ((log, frames), (quarter, frames // 4), (part, min(PART, frames))):
            make_log(file, count)
        # compile
        check(part)
        decode(part)
        for _ in range(REPEATS):
            times["check"].append(seconds(check, log))
            times["decode"].append(seconds(decode, log))
            times["peer"].append(seconds(peer, part) * frames / min(PART, frames))
        memory = memory_mib(quarter), memory_mib(log)
    for name, label in LABELS.items():
        t = times[name]
        middle = statistics.median(t)
        print(
            f"{middle:8.3f} s  ({min(t):.3f} to {max(t):.3f}, n={len(t)})  {label}: {frames / middle / 1e6:.2f} million frames/s"
        )
    for other in ("decode", "peer"):
        ratios = [theirs / own for theirs, own in zip(times[other], times["check"], strict=True)]
        print(
            f"{LABELS[other]} / check: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        )
    print(f"most memory: {memory[0]:.0f} MiB for a quarter of the log, {memory[1]:.0f} MiB for all of it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
