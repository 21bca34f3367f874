"""How cost grows with frames, rows, machines, recordings and workers, and what 10 000 machines need; writes docs/results/scaling.md.

    python -m bench.scaling [--out docs/results/scaling.md] [--machines 10000] [--hours 24]

Everything is made of one drive of the bench, recorded first. As with bench.speed, the page is written only if the sources are committed,
the host took no processor time away and nothing else computed; else the exit code is 5 (inconclusive).
"""

import argparse
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.fleet_needs import TASK_S, Costs, amount, needs
from bench.speed import IDLE_S, INCONCLUSIVE, MOST_FOREIGN, MOST_STOLEN, Host, Load, commit, machine
from bus.frame import Frame
from bus.hub.packet import SIZE as HUB_BYTES
from dbc import loader_database
from dbc.columns import ColumnDecoder
from dbc.offline.decoding import decode_log
from dbc.offline.writing import Tables
from dbc.tables import Format
from diagnosis.fleet.cluster import carry_out
from diagnosis.fleet.store import Store
from ecu.calibration import load_calibration
from ecu.estimators.columns import estimate_columns
from hil.compose import Choice, lockstep
from hil.recording.formats import open_writer
from hil.recording.ring import records_of
from plant.lanes.ensemble import Ensemble
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from studies.campaigns.ablation import inputs_of

SCENARIO = "loaded"
REPEATS = 5
FRAMES = (50_000, 200_000, 800_000)  # of a recording
ROWS = (10_000, 40_000, 160_000)  # of the estimators
MACHINES = (1, 2, 4, 8)  # in one process, one after the other
MACHINE_TICKS = 200
ENSEMBLES = (1, 4, 8, 32, 128)  # machines without ECU
ENSEMBLE_STEPS = 500
RECORDINGS = (4, 8, 16)  # of the workers
RECORDING_ROWS = 20_000
EMPTY = (20, 220)  # tasks that do nothing: their difference is the cost of a task without the workers' start
WORKERS = (1, 2)
LEAST_EFFICIENCY = 0.5  # two workers that do no more than one were not measured, but something beside them
BATCH = 400  # frames that the recorder writes at a time


@dataclass(frozen=True, slots=True)
class Taken:
    """Repeated measurements of one amount of work."""

    wall_s: Sequence[float]
    processor_s: Sequence[float]

    @classmethod
    def of(cls, work: Callable[[], object], repeats: int = REPEATS) -> "Taken":
        wall, processor = [], []
        for _ in range(repeats):
            start, used = time.perf_counter(), time.process_time()
            work()
            processor.append(time.process_time() - used)
            wall.append(time.perf_counter() - start)
        return cls(wall, processor)

    def cells(self, count: int) -> str:
        """Wall time, processor time for each of so many, and its range."""
        each = [seconds / count * 1e6 for seconds in self.processor_s]
        middle = statistics.median(each)
        return f"{statistics.median(self.wall_s):.3g} | {middle:.3g} | {min(each):.3g}..{max(each):.3g}"

    def each_s(self, count: int) -> float:
        """Processor time for each of so many."""
        return statistics.median(self.processor_s) / count


HEAD = "| {} | wall [s] | processor [µs] each | range |\n|---:|---:|---:|---:|"


def drive() -> list[Frame]:
    """The frames of the drive."""
    return lockstep(Choice(scenario=SCENARIO).load(), reference=False).run().bus


def repeated(frames: Sequence[Frame], count: int) -> Iterator[Frame]:
    """So many frames: the drive again and again, in the order of time."""
    length_ns = frames[-1].at_ns + 10_000_000
    for k in range(count):
        frame = frames[k % len(frames)]
        yield frame._replace(at_ns=frame.at_ns + k // len(frames) * length_ns)


def write(path: Path, frames: Sequence[Frame]) -> None:
    """As the recorder writes them."""
    writer = open_writer(path, ["can0"])
    for first in range(0, len(frames), BATCH):
        writer.write(records_of(frames[first : first + BATCH]))
    writer.close()


def decoded(path: Path) -> None:
    """Every signal of every frame, dropped."""
    decode_log(path, ColumnDecoder(loader_database()), take=lambda frames, columns: None)


def tables_bytes(path: Path, out: Path) -> int:
    """Bytes of the Parquet tables of a recording."""
    with Tables(out, path, Format.PARQUET, several=False, j1939=False) as tables:
        decode_log(path, ColumnDecoder(loader_database()), take=tables.take)
        tables.finish()
    return sum(file.stat().st_size for file in out.rglob("*.parquet"))


def estimated(file: str) -> dict[str, float]:
    """The task of a worker: the estimates of one recording, on one core."""
    found = estimate_columns(np.load(file), load_calibration().parameters, cores=1)
    return {"margin": float(found[:, 0].min())}


def nothing(number: int) -> dict[str, float]:
    """A task that does nothing."""
    return {"number": float(number)}


def carried(work: Callable[..., dict[str, float]], arms: Sequence[object], workers: int) -> float:
    """Seconds that workers of this machine take for these tasks, their start included."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder), {"work": work.__name__})
        start = time.perf_counter()
        tally = carry_out(work, {str(k): arm for k, arm in enumerate(arms)}, store, workers=workers)
        assert not tally.failures, tally.failures
        return time.perf_counter() - start


def grown(
    title: str, what: str, works: dict[int, Callable[[], object]]
) -> tuple[list[str], dict[int, Taken]]:
    """A table of cost against amount."""
    taken = {count: Taken.of(work) for count, work in works.items()}
    rows = [f"| {count} | {one.cells(count)} |" for count, one in taken.items()]
    return [f"## {title}", "", HEAD.format(what), *rows, ""], taken


def measured(folder: Path) -> tuple[list[str], Costs]:
    """The page's tables, and the costs that the plan follows from."""
    frames = drive()
    seconds = frames[-1].at_ns * 1e-9
    text: list[str] = []

    logs = {count: folder / f"{count}.blf" for count in FRAMES}
    recorded = {}
    for count, path in logs.items():
        many = list(repeated(frames, count))
        recorded[count] = Taken.of(
            lambda many=many, path=path: (path.unlink(missing_ok=True), write(path, many))
        )
    text += ["## Frames recorded as BLF", "", HEAD.format("frames")]
    text += [f"| {count} | {one.cells(count)} |" for count, one in recorded.items()]
    text += [""]
    decoded(logs[FRAMES[0]])  # compile
    part, decoding = grown(
        "Frames of a BLF decoded", "frames", {n: lambda path=path: decoded(path) for n, path in logs.items()}
    )
    text += part

    sizes = []
    for suffix in (".log", ".blf", ".mf4"):
        path = folder / f"drive{suffix}"
        write(path, frames)
        sizes.append((f"recording, {suffix}", path.stat().st_size))
    sizes.append(("tables of signals, Parquet", tables_bytes(folder / "drive.log", folder / "tables")))
    text += ["## Bytes of a frame", "", f"Of a drive of {seconds:.0f} s with {len(frames)} frames.", ""]
    text += ["| form | bytes |", "|---|---:|"]
    text += [f"| {name} | {size / len(frames):.1f} |" for name, size in sizes]
    text += [f"| record between hub and clients | {HUB_BYTES} |", ""]

    calibration = load_calibration()
    some = inputs_of(frames, calibration)[1]
    rows = np.tile(some, (max(ROWS) // len(some) + 1, 1))
    parameters = calibration.parameters
    estimate_columns(rows[:10], parameters)
    estimating = {}
    for cores in WORKERS:
        part, taken = grown(
            f"Rows of the estimators with the outlook, {cores} core{'s' if cores > 1 else ''}",
            "rows",
            {n: lambda n=n, cores=cores: estimate_columns(rows[:n], parameters, cores=cores) for n in ROWS},
        )
        text, estimating[cores] = text + part, taken

    part, _ = grown(
        f"Machines in one process, {MACHINE_TICKS} ticks of lockstep each (per tick and machine)",
        "ticks of all",
        {n * MACHINE_TICKS: lambda n=n: stepped(n) for n in MACHINES},
    )
    text += part

    part, _ = grown(
        f"Machines without ECU side by side in vectors, {ENSEMBLE_STEPS} steps of 1 ms each (per step and machine)",
        "steps of all",
        {n * ENSEMBLE_STEPS: ensemble_of(n) for n in ENSEMBLES},
    )
    text += part

    np.save(folder / "rows.npy", rows[:RECORDING_ROWS])
    task, efficiency, part = workers_table(str(folder / "rows.npy"))
    text += part
    most = max(FRAMES)
    by_name = dict(sizes)
    return text, Costs(
        frames_per_s=len(frames) / seconds,
        rows_per_s=len(some) / seconds,
        record_s=recorded[most].each_s(most),
        decode_s=decoding[most].each_s(most),
        estimate_s=estimating[1][max(ROWS)].each_s(max(ROWS)),
        task_s=task,
        efficiency=efficiency,
        recorded_bytes=by_name["recording, .blf"] / len(frames),
        table_bytes=by_name["tables of signals, Parquet"] / len(frames),
        stream_bytes=by_name["recording, .blf"] / len(frames),
    )


def stepped(count: int) -> None:
    """So many machines, one after the other."""
    for seed in range(count):
        bench = lockstep(Choice(scenario=SCENARIO, seed=seed).load())
        for _ in range(MACHINE_TICKS):
            bench.step()


def ensemble_of(count: int) -> Callable[[], object]:
    """The motion of so many machines, on all processors."""
    machine = load_machine("l60")
    ensemble = Ensemble([Plant(machine, payload_mass=10.0 * i, speed=3.0) for i in range(count)])
    command = Commands(wheel_torque=(500.0,) * 4).vector()
    ensemble.advance(command, 0.0)  # compile
    return lambda: ensemble.advance(command, ENSEMBLE_STEPS * 1e-3)


def workers_table(file: str) -> tuple[float, float, list[str]]:
    """Seconds per empty task, efficiency of two workers, and the tables."""
    text = ["## Recordings and workers (dask, processes of this machine)", ""]
    text += ["| recordings | workers | wall [s] | range | recordings/s |", "|---:|---:|---:|---:|---:|"]
    rates = {}
    for count in RECORDINGS:
        for workers in WORKERS:
            found = [carried(estimated, [file] * count, workers) for _ in range(REPEATS)]
            rates[count, workers] = statistics.median(found)
            text.append(
                f"| {count} | {workers} | {statistics.median(found):.2f} | {min(found):.2f}..{max(found):.2f} | "
                f"{count / statistics.median(found):.2f} |"
            )
    few, many = (
        statistics.median([carried(nothing, list(range(n)), max(WORKERS)) for _ in range(REPEATS)])
        for n in EMPTY
    )
    task = max(many - few, 0.0) / (EMPTY[1] - EMPTY[0])
    # by the difference of many and few recordings, in which the start of the workers drops out
    one, two = (rates[max(RECORDINGS), w] - rates[min(RECORDINGS), w] for w in WORKERS)
    efficiency = min(one / two / 2.0, 1.0) if min(one, two) > 0.0 else math.nan
    text += [
        "",
        f"A task that does nothing takes {task * 1e3:.2f} ms, from {EMPTY[1]} against {EMPTY[0]} of them, its result kept; "
        f"starting {max(WORKERS)} workers takes {few - EMPTY[0] * task:.1f} s. Two workers do {2.0 * efficiency:.2f} times the work of one.",
        "",
    ]
    return task, efficiency, text


def plan(costs: Costs, machines: int, hours: float) -> list[str]:
    """The table of needs."""
    rows = [f"| {n.what} | {amount(n)} | {n.follows} |" for n in needs(costs, machines, hours)]
    return [
        f"## What {machines} machines need that stream {hours:g} h a day",
        "",
        f"From the figures below. A task is {TASK_S / 3600:g} h of one machine. The stream is taken as compressed as a BLF; uncompressed it is "
        f"{HUB_BYTES / costs.stream_bytes:.0f} times as much (records of the hub). More than {max(WORKERS)} workers were not measured: one scheduler "
        "hands out tasks, and its time per task bounds them.",
        "",
        "| what | amount | follows from |",
        "|---|---:|---|",
        *rows,
        "",
    ]


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m bench.scaling",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="write the page there, if it may be published"
    )
    parser.add_argument("--machines", type=int, default=10_000)
    parser.add_argument("--hours", type=float, default=24.0)
    options = parser.parse_args(argv)
    before = Host.now()
    time.sleep(IDLE_S)  # what is busy now would be busy later
    loads = [Load.between("before", before, Host.now())]
    reasons = list(loads[0].reasons)
    if not commit()[1]:
        reasons.append("the sources differ from the commit: commit first")
    if options.out is not None and reasons:
        print("not measured, since nothing could be published:\n" + "\n".join(reasons), file=sys.stderr)
        return INCONCLUSIVE
    before = Host.now()
    with tempfile.TemporaryDirectory() as folder:
        tables, costs = measured(Path(folder))
    loads.append(Load.between("measuring", before, Host.now()))
    reasons += loads[-1].reasons
    if not costs.efficiency > LEAST_EFFICIENCY:
        reasons.append(
            "the time of the workers does not follow from the number of recordings: too much noise"
        )
    text = "\n".join(
        [
            "# Scaling",
            "",
            f"Made by `python -m bench.scaling --out docs/results/scaling.md` at commit {commit()[0]}. {machine()}. Medians and ranges of "
            f"{REPEATS} repeats. While measuring others used {loads[-1].foreign:.2f} processors (at most {MOST_FOREIGN:.2f}), and the host took "
            f"{loads[-1].stolen:.1%} away (at most {MOST_STOLEN:.0%}).",
            "",
            *plan(costs, options.machines, options.hours),
            *tables,
        ]
    )
    if options.out is None or reasons:
        print(text)
        if reasons:
            print("not published:\n" + "\n".join(reasons), file=sys.stderr)
            return INCONCLUSIVE
        return 0
    options.out.write_text(text, encoding="utf-8")
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
