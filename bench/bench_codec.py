"""Live codec against cantools, frame by frame: decode and encode of every message of loader.dbc.

    python bench/bench_codec.py

Both sides decode the same frames in one run, repetitions interleaved; medians over repetitions of the mean time
per frame. cantools is asked for plain numbers (decode_choices=False), as the loop needs them.
"""

import platform
import statistics
import sys
import time
from importlib.metadata import version

import cantools
import numpy as np

from dbc import FOLDER, loader_database
from dbc.binding import Binding

FRAMES = 2000
# Odd, so that the median is one of the measured values.
REPEATS = 15


def microseconds(work, items) -> float:
    start = time.perf_counter()
    for item in items:
        work(*item)
    return (time.perf_counter() - start) / len(items) * 1e6


def main() -> int:
    ours, theirs = loader_database(), cantools.database.load_file(FOLDER / "loader.dbc")
    rng = np.random.default_rng(1)
    rows: dict[str, list[tuple[object, ...]]] = {
        name: [] for name in ("decode", "peer decode", "encode", "peer encode")
    }
    for i in range(FRAMES):
        codec = list(ours.by_name.values())[i % len(ours.by_name)]
        message = theirs.get_message_by_name(codec.name)
        # random content: constant bytes would favour whoever caches
        data = bytes(rng.integers(0, 256, codec.length, np.uint8))
        values = message.decode(data, decode_choices=False)
        # encoded from the decoded values, so that both directions are measured on the same frame
        data = message.encode(values, strict=False)
        rows["decode"].append((codec, data))
        rows["peer decode"].append((message, data))
        # each side gets values in its own form: a tuple in the DBC's order here, a dict by name there
        rows["encode"].append((codec, tuple(values.values())))
        rows["peer encode"].append((message, values))
    # what the plant's and the ECU's loops call: a codec bound to the SI units of their signals
    articulation = Binding(
        ours.by_name["Articulation"],
        {"ArticulationAngle": "rad", "ArticulationRate": "rad/s", "SampleSequence": "1", "State": "1"},
    )
    works = {
        "decode": lambda codec, data: codec.decode(data),
        "peer decode": lambda message, data: message.decode(data, decode_choices=False),
        "encode": lambda codec, values: codec.encode(values),
        "peer encode": lambda message, values: message.encode(values, strict=False),
        "binding decode": lambda data: articulation.decode(data),
        "binding encode": lambda values: articulation.encode(values),
    }
    angle = articulation.encode((0.3, 0.1, 7.0, 0.0))
    rows["binding decode"] = [(angle,)] * FRAMES
    rows["binding encode"] = [((0.3, 0.1, 7.0, 0.0),)] * FRAMES
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(REPEATS):
        for name, work in works.items():
            times[name].append(microseconds(work, rows[name]))
    print(
        f"{platform.machine()}, Python {platform.python_version()}, cantools {version('cantools')}, "
        f"{FRAMES} frames of {len(ours.by_name)} messages, n={REPEATS}"
    )
    for name, t in times.items():
        print(f"{statistics.median(t):7.3f} us/frame ({min(t):.3f} to {max(t):.3f})  {name}")
    for what in ("decode", "encode"):
        ratio = statistics.median(times[f"peer {what}"]) / statistics.median(times[what])
        print(f"{what}: {ratio:.1f}x cantools")
    return 0


if __name__ == "__main__":
    sys.exit(main())
