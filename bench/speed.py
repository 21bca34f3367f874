"""Runs every benchmark and writes docs/results/speed.md, with machine, commit and load. For releases; takes some ten minutes.

    python -m bench.speed [--out docs/results/speed.md] [--only NAME...]

Each figure stands beside its peer, measured in the same run, and beside a physical floor. The page is written only if the figures mean
something: the sources are committed, the host took hardly any processor time away, and nothing else computed. A benchmark that was disturbed
is run again after the others, at most --tries times in all: a guest of the same host that is busy now may be gone in some minutes. The load
decides which run counts, never its figures. If none was quiet, the reasons and the figures are printed, no file is written, and the exit
code is 5 (inconclusive).
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

from bench.speed_kept import keep, kept
from bench.speed_load import MOST_FOREIGN, MOST_STOLEN, Host, Load

ROOT = Path(__file__).resolve().parent.parent
# The exit code of the command line for what could not be judged (hil.ending).
INCONCLUSIVE = 5
IDLE_S = 5.0  # watched before the first benchmark
FRAME_BYTES = 45 + 64  # read of a candump line, and written of its decoded signals (some eight of 8 bytes)
NUMBER = r"[-+]?[\d.,]+(?:e[-+]?\d+)?"

Reading = tuple[float, float, float]  # median, least, most
Readings = Mapping[tuple[str, str], Reading]  # by benchmark and label


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One line of the page. Labels are those that the benchmark prints."""

    what: str
    unit: str
    bench: str
    label: str
    peer: str = ""  # label in the same benchmark; none where there is nothing to compare with
    peer_name: str = ""
    floor: Callable[[Readings], float] | None = None  # in the figure's unit
    floor_name: str = ""
    more_is_better: bool = False
    scale: float = 1.0  # from the printed number to the unit
    per: float = 0.0  # the printed number is a time for so many: the unit counts them per second
    # what the benchmark gave on a quiet machine with 2 processors before decisions 48 and 49, in the unit
    before: float | None = None


def _of(bench: str, label: str) -> Callable[[Readings], float]:
    return lambda readings: readings[bench, label][0]


FIGURES = (
    Figure(
        what="plant, one step of 1 ms",
        unit="us",
        bench="bench_plant",
        label="plant, semi-implicit",
        peer="MuJoCo, compiled tyres, looped in C",
        peer_name="MuJoCo in C, our tyres",
        floor=_of("bench_plant", "MuJoCo, no tyres, looped in C"),
        floor_name="MuJoCo's bodies alone, no tyres (not a floor of ours)",
        before=3.40,
    ),
    Figure(
        what="plant with one compiled effect, one step",
        unit="us",
        bench="bench_effects",
        label="one compiled effect, pivot_friction: joints",
        floor=_of("bench_effects", "plain"),
        floor_name="the plain plant",
    ),
    Figure(
        what="eight machines side by side, one step of one of them",
        unit="us",
        bench="bench_lanes",
        label="8 machines side by side, no effects",
        peer="8 machines one by one, no effects",
        peer_name="one by one",
    ),
    Figure(
        what="the same with one compiled effect",
        unit="us",
        bench="bench_lanes",
        label="8 machines side by side, an effect, rolling_resistance",
        peer="8 machines one by one, an effect, rolling_resistance",
        peer_name="one by one",
    ),
    Figure(
        what="lockstep, by processor time",
        unit="x real time",
        bench="bench_lockstep",
        label="by processor time",
        floor=lambda r: 1000.0 / r["bench_plant", "plant, semi-implicit"][0],
        floor_name="dynamics alone",
        more_is_better=True,
        before=30.0,
    ),
    Figure(
        what="lockstep with the ECU in C, by processor time",
        unit="x real time",
        bench="bench_ecu_core",
        label="lockstep, C core",
        peer="lockstep, Python core",
        peer_name="ECU in Python",
        more_is_better=True,
    ),
    Figure(
        what="ECU in C, one cycle",
        unit="us",
        bench="bench_ecu_core",
        label="C core",
        peer="Python core",
        peer_name="ECU in Python",
    ),
    Figure(
        what="ECU with sensors tested against each other, one cycle",
        unit="us",
        bench="bench_ecu_core",
        label="Python core, sensors tested",
        peer="cantools, decoding alone",
        peer_name="cantools decoding the frames, nothing else",
        floor=_of("bench_ecu_core", "Python core"),
        floor_name="the same without the test",
    ),
    Figure(what="ECU, one cycle", unit="us", bench="bench_ecu", label="collector on, processor"),
    Figure(
        what="ECU on columns, outlook included",
        unit="million samples/s",
        bench="bench_ecu",
        label="columns",
        peer="the compiled step, row by row from Python",
        peer_name="row by row from Python",
        more_is_better=True,
        before=0.05,
    ),
    Figure(
        what="live decode of a frame",
        unit="us",
        bench="bench_codec",
        label="decode",
        peer="peer decode",
        peer_name="cantools",
        floor=_of("floors", "function call [us]"),
        floor_name="an empty Python call",
        before=0.69,
    ),
    Figure(
        what="hub, one way at 1000 frames/s (p50)",
        unit="us",
        bench="bench_bus",
        label="hub",
        peer="raw relay",
        peer_name="raw relay",
        floor=_of("bench_bus", "direct"),
        floor_name="one socket",
    ),
    Figure(
        what="hub, processor time at 40 000 frames/s",
        unit="us/frame",
        bench="bench_hub",
        label="hub",
        floor=_of("bench_hub", "bytes moved"),
        floor_name="the same bytes moved",
    ),
    Figure(
        what="offline decode of a candump log",
        unit="million frames/s",
        bench="bench_decode",
        label="candump log, column decoder",
        peer="asammdf extract_bus_logging (MF4 of the same frames)",
        peer_name="asammdf",
        floor=lambda r: r["floors", "memory bandwidth [GB/s]"][0] * 1e3 / FRAME_BYTES,
        floor_name="memory bandwidth",
        more_is_better=True,
        per=1.0,  # of a million frames, which the benchmark decodes
        before=6.1,
    ),
    Figure(
        what="offline decode of a candump log to Parquet",
        unit="million frames/s",
        bench="bench_decode",
        label="candump log to Parquet",
        more_is_better=True,
        per=1.0,
    ),
    Figure(
        what="offline decode of a BLF",
        unit="million frames/s",
        bench="bench_decode",
        label="BLF, column decoder",
        peer="python-can BLFReader + cantools",
        peer_name="python-can with cantools",
        floor=lambda r: (
            1 / r["bench_decode", "floor: the BLF's containers inflated by zlib on one processor"][0]
        ),
        floor_name="zlib on one processor (we use two, and isal)",
        more_is_better=True,
        per=1.0,
    ),
    Figure(
        what="reading a candump log into arrays",
        unit="us/frame",
        bench="bench_files",
        label="read .log",
        peer="read .log, python-can",
        peer_name="python-can",
    ),
    Figure(
        what="writing MF4, whole after every batch",
        unit="us/frame",
        bench="bench_files",
        label="write .mf4",
        peer="write .mf4, python-can",
        peer_name="python-can",
        floor=_of("floors", "system call [us]"),
        floor_name="a system call (we need some four per 400 frames)",
    ),
)


def readings(bench: str, output: str) -> dict[tuple[str, str], Reading]:
    """Figures in a benchmark's output: table rows `| label | median | min..max |` or `| label | median (min to max) |`, and lines
    `median unit (min to max)  label`. The first of several with one label counts."""
    found: dict[tuple[str, str], Reading] = {}
    # the tables of the benchmarks as they print them; a new form needs a line here, or its figure is missing
    forms = (
        rf"^\| (?P<label>[^|]+?) \| (?P<m>{NUMBER}) \| (?P<a>{NUMBER})\.\.(?P<b>{NUMBER}) \|",
        rf"^\| (?P<label>[^|]+?) \| (?P<m>{NUMBER}) \((?P<a>{NUMBER}) to (?P<b>{NUMBER})\) \|",
        rf"^\s*(?P<m>{NUMBER}) [^(]*\((?P<a>{NUMBER}) to (?P<b>{NUMBER})[^)]*\)\s+(?P<label>.+?)$",
        rf"^(?P<label>(?:read|write) \S+)\s+(?P<m>{NUMBER}) us/frame \((?P<a>{NUMBER}) to (?P<b>{NUMBER})\)",
        rf"^(?P<left>(?:read|write) \S+) .*(?P<label>python-can)\s+(?P<m>{NUMBER}) \((?P<a>{NUMBER}) to (?P<b>{NUMBER})\)",
    )
    for line in output.splitlines():
        for form in forms:
            if (match := re.match(form, line)) is None:
                continue
            parts = match.groupdict()
            label = ", ".join(part for part in (parts.get("left"), parts["label"]) if part)
            values = tuple(float(parts[key].rstrip(".").replace(",", "")) for key in ("m", "a", "b"))
            # the first table of a benchmark is the one that the page refers to
            found.setdefault((bench, label), (values[0], values[1], values[2]))
    return found


@dataclass(slots=True)
class Session:
    """Outputs and loads of all benchmarks that ran."""

    folder: Path | None = None  # of runs that counted, of this commit
    outputs: dict[str, str] = field(default_factory=dict)
    loads: list[Load] = field(default_factory=list)
    disturbed: dict[str, str] = field(default_factory=dict)  # why a benchmark has no figures

    @property
    def readings(self) -> dict[tuple[str, str], Reading]:
        """The figures of all runs that count."""
        quiet = {name: text for name, text in self.outputs.items() if name not in self.disturbed}
        return {key: r for name, output in quiet.items() for key, r in readings(name, output).items()}

    def measure(self, names: Sequence[str], tries: int) -> list[str]:
        """Run benchmarks, those that were disturbed again after the others. Returns why the last run of any does not count; nothing if all
        do. Raises CalledProcessError."""
        last: dict[str, Load] = {}
        for name in names:
            if self.folder is not None and (before := kept(self.folder, name)) is not None:
                self.outputs[name], last[name] = before
        for disturbed in range(tries):
            for name in names:
                if name not in last or last[name].reasons:
                    last[name] = replace(self._run(name), disturbed=disturbed)
                    if self.folder is not None and not last[name].reasons:
                        keep(self.folder, name, self.outputs[name], last[name])
        self.loads += [last[name] for name in names]
        self.disturbed = {name: "; ".join(last[name].reasons) for name in names if last[name].reasons}
        return [reason for name in names for reason in last[name].reasons]

    def _run(self, name: str) -> Load:
        """Run one benchmark and keep what it prints."""
        print(f"{name} ...", file=sys.stderr, flush=True)
        before = Host.now()
        command = [sys.executable, "-m", f"bench.{name}"]
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
        self.outputs[name] = done.stdout
        load = Load.between(name, before, Host.now())
        for reason in load.reasons:
            print(f"  disturbed: {reason}", file=sys.stderr, flush=True)
        return load


def line_or_reason(figure: Figure, found: Readings, disturbed: Mapping[str, str]) -> str:
    """One row of the page's table; of a benchmark that was disturbed, the reason. KeyError as of `line`."""
    if figure.bench in disturbed:
        return f"| {figure.what} | not measured: {disturbed[figure.bench]} | – | – | – | – | – | – |"
    try:
        return line(figure, found)
    except KeyError:
        if figure.floor is None or not disturbed:
            raise
        # the floor may come from another benchmark, which was disturbed
        return line(replace(figure, floor=None), found)


def line(figure: Figure, found: Readings) -> str:
    """One row of the page's table. Raises KeyError if the benchmark did not print what the figure needs."""
    own = converted(figure, found[figure.bench, figure.label])
    cells = [figure.what, f"{own[0]:.3g} {figure.unit}", f"{own[1]:.3g} to {own[2]:.3g}"]
    cells.append("–" if figure.before is None else f"{figure.before:.3g}")
    if figure.peer:
        peer = converted(figure, found[figure.bench, figure.peer])
        ratio = own[0] / peer[0] if figure.more_is_better else peer[0] / own[0]
        cells += [f"{figure.peer_name} {peer[0]:.3g}", f"{ratio:.2f}"]
    else:
        cells += ["–", "–"]
    if figure.floor is not None:
        floor = figure.floor(found)
        away = floor / own[0] if figure.more_is_better else own[0] / floor
        cells += [f"{figure.floor_name} {floor:.3g}", f"{away:.2f}"]
    else:
        cells += ["–", "–"]
    return "| " + " | ".join(cells) + " |"


def converted(figure: Figure, reading: Reading) -> Reading:
    """The reading in the figure's unit; of a time for so many, how many in a second."""
    middle, least, most = reading
    if figure.per:
        # the inverse turns least and most round
        return figure.per / middle, figure.per / most, figure.per / least
    return middle * figure.scale, least * figure.scale, most * figure.scale


def machine() -> str:
    """Processor, memory, kernel and versions, in one line."""
    cpu = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba"))
    name = cpu[1] if cpu else platform.machine()
    return f"{name}, {os.cpu_count()} processors, {memory:.0f} GiB, Linux {platform.release()}, Python {platform.python_version()}, {packages}"


def commit() -> tuple[str, bool]:
    """The checkout's commit, and whether its sources are as committed."""

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(ROOT), *words], stdout=subprocess.PIPE, text=True, check=True
        ).stdout.strip()

    return git("rev-parse", "--short=10", "HEAD"), not git("status", "--porcelain", "--untracked-files=no")


def page(session: Session, figures: Sequence[Figure]) -> str:
    """The whole page."""
    found = session.readings
    head = "| figure | measured | range | before | peer, in the same run | times as fast as the peer | floor | times the floor |"
    loads = [
        "| benchmark | seconds | processors used by others | stolen | disturbed runs before |",
        "|---|---:|---:|---:|---:|",
    ]
    loads += [
        f"| {load.name} | {load.seconds:.0f} | {load.foreign:.2f} | {load.stolen:.1%} | {load.disturbed} |"
        for load in session.loads
    ]
    printed = [
        f"### {name}\n\n```text\n{output.strip()}\n```\n"
        for name, output in session.outputs.items()
        if name not in session.disturbed
    ]
    return "\n".join(
        [
            "# Speed",
            "",
            f"Made by `python -m bench.speed --out docs/results/speed.md` at commit {commit()[0]}. {machine()}.",
            "Medians and ranges over the repeats of one run. A floor is what the machine needs for the unavoidable part alone. "
            "*Before* is what the same benchmark gave on a quiet machine with 2 processors before "
            "[decisions 48](../adr/0048-references-not-counted.md) and [49](../adr/0049-lockstep-core-and-lanes.md), in a run of its own.",
            "One aim is missed: the ECU on columns was to do half a million samples a second. [Decisions 56](../adr/0056-outlook-beside-the-present.md) and "
            "[81](../adr/0081-predictions-side-by-side.md) say what was tried.",
            "",
            head,
            "|---|---:|---:|---:|---|---:|---|---:|",
            *(line_or_reason(figure, found, session.disturbed) for figure in figures),
            "",
            "## Load while measuring",
            "",
            f"A run does not count beyond {MOST_FOREIGN:.2f} processors used by others or {MOST_STOLEN:.0%} stolen time. It is then made again; its figures are not looked at. Runs that count are kept, so that they may be of several calls at the same commit.",
            "",
            *loads,
            "",
            "## As printed",
            "",
            *printed,
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m bench.speed",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="write the page there, if it may be published"
    )
    benches = list(dict.fromkeys(["floors", *(f.bench for f in FIGURES)]))
    parser.add_argument(
        "--only", nargs="+", choices=benches, metavar="NAME", help="only these benchmarks; nothing is written"
    )
    parser.add_argument(
        "--tries", type=int, default=5, metavar="N", help="runs of a benchmark that is disturbed (default: 5)"
    )
    options = parser.parse_args(argv)
    if options.tries < 1:
        parser.error(f"--tries {options.tries}: at least 1")
    chosen = options.only or benches
    sources, committed = commit()
    session = Session(ROOT / "out" / "speed" / sources if committed else None)
    before = Host.now()
    # nothing of ours runs meanwhile: what is busy now would be busy later
    time.sleep(IDLE_S)
    session.loads.append(Load.between("before the first", before, Host.now()))
    reasons = list(session.loads[0].reasons)
    # figures of sources that nobody can check out cannot be repeated
    if not committed:
        reasons.append("the sources differ from the commit: commit first")
    if options.out is not None and reasons:  # some ten minutes of figures that could not be published
        print("not measured, since nothing could be published:\n" + "\n".join(reasons), file=sys.stderr)
        return INCONCLUSIVE
    reasons += session.measure(chosen, options.tries)
    have = session.readings
    figures = [f for f in FIGURES if not options.only or _complete(f, have)]
    text = page(session, figures)
    if options.out is None or options.only or 2 * len(session.disturbed) > len(chosen):
        print(text)
        if options.out is not None and not options.only:
            print("not published: most benchmarks were disturbed", file=sys.stderr)
    else:
        options.out.write_text(text, encoding="utf-8")
        print(options.out)
    if reasons:
        print("disturbed:\n" + "\n".join(reasons), file=sys.stderr)
        return INCONCLUSIVE
    return 0


def _complete(figure: Figure, have: Readings) -> bool:
    """Whether all readings that a figure needs are there."""
    try:
        line(figure, have)
    except KeyError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
