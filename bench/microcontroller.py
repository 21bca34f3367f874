"""The exported ECU in figures: equality with the Python ECU, and what it costs a Cortex-M4F.

    python -m bench.microcontroller --out docs/results/microcontroller.md

Every scenario is run in lockstep with the Python ECU; the frames that it received go through the C ECU in double and in single precision,
through perturbed builds (Monte Carlo arithmetic), and through QEMU. Then random frames.
"""

import argparse
import ctypes
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from bench.speed import commit
from bus.frame import Frame
from dbc import loader_database
from deploy.c.core import C
from deploy.c.estimators import estimator_files
from deploy.c.project import write_project
from deploy.c.replays import answers_of, frames_file
from ecu.calibration import load_calibration
from ecu.core import PYTHON
from ecu.cycle import EcuCycle
from ecu.findings import EstimatorFailed, Finding, StateChanged
from hil.compose import Choice, plant_unit
from hil.lockstep import Lockstep
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import RandomDrive
from tests.deploy.c.test_ecu_in_c import CHOSEN, CHOSEN_SIGNALS

SCENARIOS = (
    "abrupt_articulation", "hard_braking", "high_articulation", "loaded", "pile_entry", "standstill", "transient_articulation",
    "transient_torque", "unloaded", "wheel_lock",
)  # fmt: skip
DRAWS = int(os.environ.get("DRAWS", "8"))
DATABASE = loader_database()
Calls = list[tuple[Frame | None, int]]
Sent = list[list[tuple[int, bytes]]]
CLOCK_MHZ, CLOCKS = 180, 1.5
"""A usual Cortex-M4F, and clocks per instruction of code that is mostly floating-point arithmetic: an assumption, not a measurement."""


class Kept:
    """The Python ECU, keeping what it receives and sends."""

    def __init__(self, ecu: EcuCycle | None = None) -> None:
        self._ecu = ecu or EcuCycle(load_calibration())
        self.calls: Calls = []
        self.sent: Sent = []

    def receive(self, frame: Frame, now_ns: int) -> list:
        self.calls.append((frame, now_ns))
        return self._ecu.receive(frame, now_ns)

    def tick(self, now_ns: int):
        tick = self._ecu.tick(now_ns)
        self.calls.append((None, now_ns))
        self.sent.append([(f.can_id, bytes(f.data)) for f in tick.frames])
        return tick


def answers(
    library: Path,
    calls: Iterable[tuple[Frame | None, int]],
    seed: int | None = None,
    *,
    detects: bool = False,
) -> Sent:
    """What a build of the C ECU sends; detects: whether it tests its sensors against each other."""
    ecu = BuiltEcu(library, detect_faults=detects)
    if seed is not None:
        ctypes.CDLL(str(library)).perturbed_start(ctypes.c_uint64(seed))
    found: Sent = []
    for frame, now in calls:
        if frame is not None:
            ecu.receive(frame, now)
        else:
            found.append([(f.can_id, f.data) for f in ecu.tick(now).frames])
    return found


def compared(found: Sent, expected: Sent) -> tuple[int, int, int, int]:
    """Frames that differ; then of their signals the measured ones with the most steps between them, and the chosen ones."""
    frames = measured = steps = chosen = 0
    assert [[i for i, _ in tick] for tick in found] == [[i for i, _ in tick] for tick in expected]
    for ours, theirs in zip(found, expected, strict=True):
        for (can_id, data), (_, other) in zip(ours, theirs, strict=True):
            if data == other:
                continue
            frames += 1
            codec = DATABASE.by_id[can_id]
            for signal, a, b in zip(codec.layout, codec.decode(data), codec.decode(other), strict=True):
                if a == b or signal.name in ("Crc", "AliveCounter"):
                    continue
                if codec.name in CHOSEN or f"{codec.name}.{signal.name}" in CHOSEN_SIGNALS:
                    chosen += 1
                else:
                    measured, steps = measured + 1, max(steps, abs(round((a - b) / signal.scale)))
    return frames, measured, steps, chosen


def run(*words: str | Path, folder: Path | None = None) -> str:
    """Output of a command that has to succeed."""
    return subprocess.run(
        [str(w) for w in words], cwd=folder, capture_output=True, text=True, check=True
    ).stdout


class Builds:
    """Every build of the exported folder, each made when it is asked for."""

    def __init__(self, folder: Path) -> None:
        self.c = folder / "c"
        write_project(self.c, load_calibration())
        self._perturbed = folder / "perturbed"

    @cached_property
    def double(self) -> Path:
        """In double precision."""
        return self._library(self.c, "double", "-DECU_DOUBLE")

    @cached_property
    def single(self) -> Path:
        """In single precision, as the board's."""
        return self._library(self.c, "single")

    @cached_property
    def perturbed(self) -> Path:
        """In double precision, each result changed at random by the rounding of single precision."""
        write_project(self._perturbed, load_calibration())
        for name, text in estimator_files(perturbed=True).items():
            (self._perturbed / name).write_text(text)
        return self._library(self._perturbed, "perturbed", "-DECU_DOUBLE", "-DECU_PERTURBED")

    @cached_property
    def sanitized(self) -> Path:
        """In single precision, ended by the first undefined behaviour."""
        options = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
        return self._library(self.c, "sanitized", "-g", *options)

    @cached_property
    def size(self) -> list[str]:
        """Of the board's firmware: text, data, bss."""
        made = run("make", "--no-print-directory", "-B", "-C", self.c, "cortex_m4/ecu.elf")
        return made.splitlines()[-1].split()

    @staticmethod
    def _library(folder: Path, name: str, *options: str) -> Path:
        out = folder / f"{name}.so"
        run(
            "gcc",
            "-std=c99",
            "-O2",
            "-shared",
            "-fPIC",
            *options,
            *sorted(folder.glob("*.c")),
            "-o",
            out,
            "-lm",
        )
        return out

    def qemu(self, calls: Calls):
        """Answers, instructions and stack of a Cortex-M4F in QEMU."""
        frames_file(self.c / "frames.bin", calls)
        run("make", "-C", self.c, "replay")
        return answers_of(self.c / "answers.bin")

    def parts(self) -> list[tuple[str, int]]:
        """Bytes of code and constants of every file for the Cortex-M4F; the libraries are the rest."""
        m4 = [
            "-mcpu=cortex-m4",
            "-mthumb",
            "-mfpu=fpv4-sp-d16",
            "-mfloat-abi=hard",
            "-fno-math-errno",
            "-ffunction-sections",
        ]
        found = []
        for source in sorted(self.c.glob("*.c")):
            run("arm-none-eabi-gcc", "-std=c99", "-O2", *m4, "-c", source, "-o", self.c / "part.o")
            found.append(
                (source.name, int(run("arm-none-eabi-size", self.c / "part.o").splitlines()[-1].split()[0]))
            )
        return found


def scenario_row(
    name: str, builds: Builds, instructions: list[int], stacks: list[int], shares: list[float]
) -> str:
    """One scenario through every build."""
    kept = Kept()
    Lockstep(plant_unit(Choice(scenario=name).load()), kept, reference=False).run()
    total = sum(map(len, kept.sent))
    double = compared(answers(builds.double, kept.calls), kept.sent)[0]
    single_sent = answers(builds.single, kept.calls)
    _, measured, steps, chosen = compared(single_sent, kept.sent)
    draws = [compared(answers(builds.perturbed, kept.calls, seed + 1), kept.sent) for seed in range(DRAWS)]
    board = builds.qemu(kept.calls)
    instructions += board.instructions
    stacks.append(board.stack)
    unlike = sum(
        a != b
        for ours, theirs in zip(board.ticks, single_sent, strict=True)
        for a, b in zip(ours, theirs, strict=True)
    )
    others = (
        f"{min(d[1] for d in draws)} to {max(d[1] for d in draws)}",
        f"{min(d[3] for d in draws)} to {max(d[3] for d in draws)}",
    )
    shares.append(chosen / max(max(d[3] for d in draws), 1))
    print(name, total, double, measured, steps, chosen, others, unlike, flush=True)
    return f"| {name} | {total} | {double} | {measured} | {others[0]} | {steps} | {chosen} | {others[1]} | {unlike} |"


@dataclass(slots=True)
class Together:
    """Python and C in double precision on one random drive: what they did, and where they differ."""

    sent: int = 0
    differ: int = 0  # of the frames sent
    findings: int = 0
    findings_differ: int = 0
    states: Counter[str] = field(default_factory=Counter)  # of every cycle
    moves: Counter[tuple[str, str]] = field(default_factory=Counter)

    def found(self, ours: Sequence[Finding], theirs: Sequence[Finding]) -> None:
        """Compare findings. As text: a value that is not a number equals no other."""
        self.findings += len(theirs)
        # what made the estimators fail is an exception's text in Python, and one bit in C
        words = [
            [EstimatorFailed.__name__ if isinstance(f, EstimatorFailed) else str(f) for f in found]
            for found in (ours, theirs)
        ]
        self.findings_differ += words[0] != words[1]
        self.moves.update(
            (f.before.name.lower(), f.after.name.lower()) for f in theirs if isinstance(f, StateChanged)
        )


def driven_together(frames: int, seed: int) -> Together:
    """So many random frames through both, call by call."""
    calibration = load_calibration()
    python, c, done = PYTHON.ecu(calibration), C.ecu(calibration), Together()
    # not kept: ten million frames and their answers take gigabytes
    for frame, now in RandomDrive(calibration, seed).calls(frames):
        if frame is not None:
            done.found(c.receive(frame, now), python.receive(frame, now))
            continue
        ours, theirs = c.tick(now), python.tick(now)
        done.found(ours.findings, theirs.findings)
        done.states[c.state.name.lower()] += 1
        done.sent += len(theirs.frames)
        pairs = zip(ours.frames, theirs.frames, strict=True)
        done.differ += sum(a.can_id != b.can_id or a.data != b.data for a, b in pairs)
    return done


def random_rows(builds: Builds, frames: int) -> list[str]:
    """Random frames through Python and C, and through the sanitized build."""
    done = driven_together(frames, 1)
    asan = run("gcc", "-print-file-name=libasan.so").strip()
    subprocess.run(
        [sys.executable, "-m", "tests.deploy.c.sanitized", str(builds.sanitized), "2", str(frames // 10)],
        env=os.environ | {"LD_PRELOAD": asan, "ASAN_OPTIONS": "detect_leaks=0"}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    cycles = done.states.total()
    seen = ", ".join(
        f"{name} {done.states[name] / cycles:.0%}" for name in ("init", "running", "degraded", "fault")
    )
    return [
        f"- {frames:,} frames of random drives through Python and C in double precision: of {done.sent:,} frames sent {done.differ:,} differ, of {done.findings:,} findings "
        f"{done.findings_differ:,}. Signals are noisy, or wild as far as they are still plausible; in bursts of 0.05 to 2 s frames are lost, late, doubled, swapped, cut, damaged, or filled with random "
        f"bits and signed, sensors stand still or report a fault, ticks are uneven. Cycles by state: {seen}; {done.moves['running', 'degraded']:,} times from running to degraded, "
        f"{done.moves['degraded', 'running']:,} back; into fault {done.moves['running', 'fault'] + done.moves['degraded', 'fault']:,} times, recovered {done.moves['fault', 'init']:,} times.",
        f"- {frames // 10:,} frames of random bits, lengths and identifiers at times that jump and run backwards, and as many of a random drive, through the single-precision build with address and "
        "undefined-behaviour sanitizers: nothing found.",
    ]


def page(
    builds: Builds,
    rows: list[str],
    random_lines: list[str],
    instructions: list[int],
    stack: int,
    share: float,
    frames: int,
) -> str:
    """The whole page."""
    revision, clean = commit()
    text, data, bss = map(int, builds.size[:3])
    ordered = sorted(instructions)
    median, p99, most = statistics.median(ordered), ordered[int(0.99 * len(ordered))], ordered[-1]
    parts = builds.parts()
    libraries = text - sum(size for _, size in parts)
    arm, qemu = (
        re.sub(r"\s*\(.*", "", run(tool, "--version").splitlines()[0])
        for tool in ("arm-none-eabi-gcc", "qemu-system-arm")
    )
    version = run("arm-none-eabi-gcc", "-dumpversion").strip()
    ms = [n * CLOCKS / CLOCK_MHZ / 1e3 for n in (median, p99, most)]
    late = " **The most costly cycle is beyond its budget**: it would end late, and the next tick be skipped and reported."
    verdict = late if ms[2] > 10.0 else ""
    return f"""# The ECU in C

Commit {revision}{"" if clean else " (with changes)"}; `make microcontroller` (`DRAWS={DRAWS} python -m bench.microcontroller --frames {frames}`); {arm} {version}, {qemu}.

## Equal to the Python ECU

The frames that the Python ECU received in a scenario go through each build of the exported C; what it sends is compared with what Python sent, frame by frame.

| scenario | frames sent | double: frames that differ | single: measured signals that differ | of the perturbed draws | most steps | single: chosen signals that differ | of the perturbed draws | QEMU against the host's single build |
|---|---:|---:|---:|---:|---:|---:|---:|---:|
{chr(10).join(rows)}

*Measured* signals are estimates and flags; *chosen* ones come from a choice among rates or from the end of a prediction (limits, predicted values, roll-over state), where two margins that are closer than the rounding give
another choice. The bound of both is what rounding does to the same equations: {DRAWS} builds in double precision whose every result is changed at random by the rounding of single precision (Monte Carlo arithmetic). Single precision
is one more such draw; of the chosen signals it changes at most {share:.2f} times as many as the draw that changes most. A frame in which QEMU and the host differ comes from their libraries: newlib and glibc may round a sine to different neighbours. *Steps*: raw numbers between the two values of a measured signal; 1 is the other neighbour of a value that lies between two.

{chr(10).join(random_lines)}

## What it costs a Cortex-M4F

`-O2`, hardware floating point, in `qemu-system-arm -M mps2-an386 -icount shift=0`. Instructions are counted by SysTick around `ecu_tick`, in steps of 40; the stack by a pattern in free memory. QEMU counts instructions, not clocks: times
are computed with {CLOCKS} clocks per instruction at {CLOCK_MHZ} MHz, an assumption.

| | | budget |
|---|---:|---:|
| code and constants | {text + data:,} B | 131,072 B |
| static memory | {data + bss:,} B (of it 3.5 kB buffers of the replay) | |
| stack | {stack:,} B | |
| static memory and stack | {data + bss + stack:,} B | 32,768 B |
| instructions per cycle, median | {median:,.0f} ({ms[0]:.1f} ms) | |
| 99th percentile | {p99:,} ({ms[1]:.1f} ms) | |
| most | {most:,} ({ms[2]:.1f} ms) | 10 ms |

| part | bytes |
|---|---:|
{chr(10).join(f"| `{name}` | {size:,} |" for name, size in parts)}
| start, replay, `libm` and `libc` less what the linker left out | {libraries:,} |

Of {len(instructions):,} cycles of {len(rows)} scenarios. Most instructions are those of the predictions behind the permitted rates.{verdict}
"""


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("docs/results/microcontroller.md"))
    parser.add_argument("--frames", type=int, default=1_000_000, help="random frames")
    parser.add_argument("--scenarios", nargs="*", default=SCENARIOS)
    options = parser.parse_args()
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        builds = Builds(Path(folder))
        instructions: list[int] = []
        stacks: list[int] = []
        shares: list[float] = []
        rows = [scenario_row(name, builds, instructions, stacks, shares) for name in options.scenarios]
        random_lines = random_rows(builds, options.frames)
        options.out.write_text(
            page(builds, rows, random_lines, instructions, max(stacks), max(shares), options.frames),
            encoding="utf-8",
        )
    print(f"{options.out} after {time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    main()
