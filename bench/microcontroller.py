"""The exported ECU in figures: equality with the Python ECU, and what it costs a Cortex-M4F.

    python -m bench.microcontroller --out docs/results/microcontroller.md

Every scenario is run in lockstep with the Python ECU; the frames that it received go through the C ECU in double and in single precision,
through perturbed builds (Monte Carlo arithmetic), and through QEMU. Then random frames.
"""

import argparse
import ctypes
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from bench.speed import commit
from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from deploy.c.estimators import estimator_files
from deploy.c.project import write_project
from deploy.c.replays import answers_of, frames_file
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from hil.compose import Choice, plant_unit
from hil.lockstep import Lockstep
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.test_ecu_in_c import CHOSEN, CHOSEN_SIGNALS, moving
from tests.ecu.machine import PERIOD_NS, FakeMachine

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

    def __init__(self) -> None:
        self._ecu = EcuCycle(load_calibration())
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


def random_calls(frames: int, seed: int) -> Iterator[tuple[Frame | None, int]]:
    """A drive whose frames are now and then lost, doubled or filled at random; a quarter of the time all of them are random.

    95 % of what is changed is signed again, so that its values are looked at. Ticks of uneven length.
    """
    generator, now, machine = random.Random(seed), 0, FakeMachine()
    protectors = {c.can_id: Protector(c) for c in DATABASE.by_id.values() if c.e2e_data_id is not None}
    made = 0
    while made < frames:
        moving(machine, machine.tick)
        share = 0.5 if machine.tick // 400 % 4 == 3 else 0.002
        for frame in machine.frames():
            data = bytes(frame.data)
            if generator.random() < share:
                data = generator.randbytes(len(data))
            if frame.can_id in protectors and generator.random() < 0.95 + 0.05 * (share < 0.1):
                data = protectors[frame.can_id].protect(data)
            chance = generator.random()
            for _ in range(0 if chance < 0.001 else 2 if chance < 0.002 else 1):
                made += 1
                yield Frame(frame.can_id, data, now), now
        now += PERIOD_NS if generator.random() < 0.98 else generator.randrange(1, 300) * 1_000_000
        yield None, now


def answers(library: Path, calls: Iterable[tuple[Frame | None, int]], seed: int | None = None) -> Sent:
    """What a build of the C ECU sends."""
    ecu = BuiltEcu(library)
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
    """Every build of the exported folder."""

    def __init__(self, folder: Path) -> None:
        self.c = folder / "c"
        write_project(self.c, load_calibration())
        perturbed = folder / "perturbed"
        write_project(perturbed, load_calibration())
        for name, text in estimator_files(perturbed=True).items():
            (perturbed / name).write_text(text)
        self.double = self._library(self.c, "double", "-DECU_DOUBLE")
        self.single = self._library(self.c, "single")
        self.perturbed = self._library(perturbed, "perturbed", "-DECU_DOUBLE", "-DECU_PERTURBED")
        self.sanitized = self._library(
            self.c,
            "sanitized",
            "-g",
            "-fsanitize=address,undefined,float-cast-overflow",
            "-fno-sanitize-recover=all",
        )
        self.size = (
            run("make", "--no-print-directory", "-C", self.c, "cortex_m4/ecu.elf").splitlines()[-1].split()
        )

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


def random_rows(builds: Builds, frames: int) -> list[str]:
    """Random frames through Python and C, and through the sanitized build."""
    kept = Kept()
    for frame, now in random_calls(frames, 1):
        if frame is not None:
            kept.receive(frame, now)
        else:
            kept.tick(now)
    double = compared(answers(builds.double, kept.calls), kept.sent)[0]
    states = Counter()
    codec = DATABASE.by_name["EcuStatus"]
    for tick in kept.sent:
        states.update(codec.decode_dict(data)["State"] for can_id, data in tick if can_id == codec.can_id)
    asan = run("gcc", "-print-file-name=libasan.so").strip()
    subprocess.run(
        [sys.executable, "-m", "tests.deploy.c.sanitized", str(builds.sanitized), "2", str(frames // 10)],
        env=os.environ | {"LD_PRELOAD": asan, "ASAN_OPTIONS": "detect_leaks=0"}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    names = {0.0: "init", 1.0: "running", 2.0: "degraded", 3.0: "fault"}
    seen = ", ".join(f"{names[s]} {n / states.total():.0%}" for s, n in sorted(states.items()))
    return [
        f"- {frames:,} frames of a drive, lost, doubled and filled at random, through Python and C in double precision: of {sum(map(len, kept.sent))} frames sent, "
        f"{double} differ. States: {seen}.",
        f"- {frames // 10:,} random frames, random lengths and identifiers, times that jump and run backwards, through the single-precision build with address and "
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
