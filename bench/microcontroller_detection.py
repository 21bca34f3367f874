"""What the detection of sensor faults costs the exported C on a Cortex-M4F, and what single precision changes: docs/results/microcontroller-detection.md.

Each scenario is driven by the Python ECU with the detection on. The frames that it received go through the C in double precision, through the
host's single-precision build and through QEMU with it, and through QEMU without it.
"""

import argparse
import statistics
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from bench.microcontroller import (
    CLOCK_MHZ,
    CLOCKS,
    SCENARIOS,
    Builds,
    Calls,
    Kept,
    answers,
    compared,
    run,
)
from bench.speed import commit
from deploy.c.replays import Answers, answers_of, frames_file
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from hil.compose import Choice, plant_unit
from hil.lockstep import Lockstep

PARTS = ("detection.c", "ecu_detection.c")
ON, OFF, LEFT_OUT = "-DREPLAY_DETECTS_FAULTS", "", "-DECU_WITHOUT_DETECTION"
BUILDS = {ON: "detection on", OFF: "detection off", LEFT_OUT: "detection left out"}
"""Options of the compiler, and what they make of the detection."""


def kept_of(scenario: str) -> Kept:
    """What the Python ECU with the detection receives and sends in a scenario."""
    kept = Kept(EcuCycle(load_calibration(), detect_faults=True))
    Lockstep(plant_unit(Choice(scenario=scenario).load()), kept, reference=False).run()
    return kept


def built(folder: Path, option: str) -> list[int]:
    """Compile the firmware with one of BUILDS; the sizes of text, data and bss."""
    said = run("make", "--no-print-directory", "-B", "-C", folder, f"OPTIONS={option}", "cortex_m4/ecu.elf")
    return [int(size) for size in said.splitlines()[-1].split()[:3]]


def replayed(folder: Path, option: str, *drives: Calls) -> Answers:
    """Answers of QEMU to drives, for each of which the ECU starts anew."""
    frames_file(folder / "frames.bin", *drives)
    run("make", "-C", folder, f"OPTIONS={option}", "replay")
    return answers_of(folder / "answers.bin")


@dataclass(slots=True)
class Cost:
    """Of one build, over all scenarios."""

    instructions: list[int] = field(default_factory=list)  # of each tick
    stack: int = 0  # its depth [bytes]
    sizes: list[int] = field(default_factory=list)  # of text, data and bss


def cost_row(what: str, cost: Cost) -> str:
    """Instructions of all cycles, and memory."""
    ordered = sorted(cost.instructions)
    text, data, bss = cost.sizes
    stack, static = cost.stack, data + bss
    numbers = (statistics.median(ordered), ordered[int(0.99 * len(ordered))], ordered[-1])
    texts = (f"{n:,.0f} ({n * CLOCKS / CLOCK_MHZ / 1e3:.1f} ms)" for n in numbers)
    return f"| {what} | {' | '.join(texts)} | {stack:,} B | {static + stack:,} B | {text + data:,} B |"


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/results/microcontroller-detection.md"))
    parser.add_argument("--scenarios", nargs="*", default=SCENARIOS)
    options = parser.parse_args()
    revision, clean = commit()
    rows, costs = [], {option: Cost() for option in BUILDS}
    with tempfile.TemporaryDirectory() as folder:
        builds = Builds(Path(folder))
        parts = dict(builds.parts())
        for name in options.scenarios:
            kept = kept_of(name)
            differ = compared(answers(builds.double, kept.calls, detects=True), kept.sent)[0]
            single = answers(builds.single, kept.calls, detects=True)
            _, measured, steps, chosen = compared(single, kept.sent)
            unlike = 0
            for option, cost in costs.items():
                cost.sizes = built(builds.c, option)
                board = replayed(builds.c, option, kept.calls)
                cost.instructions += board.instructions
                cost.stack = max(cost.stack, board.stack)
                if option == ON:
                    pairs = zip(board.ticks, single, strict=True)
                    unlike = sum(a != b for ours, theirs in pairs for a, b in zip(ours, theirs, strict=True))
            sent = sum(map(len, kept.sent))
            rows.append(f"| {name} | {sent} | {differ} | {measured} | {steps} | {chosen} | {unlike} |")
            print(rows[-1], flush=True)
    options.out.write_text(
        f"""# The detection of sensor faults on a Cortex-M4F

Commit {revision}{"" if clean else " (with changes)"}; `python -m bench.microcontroller_detection --scenarios {" ".join(options.scenarios)}`. Words and method as in [the ECU in C](microcontroller.md).

## Equal to the Python ECU

The detection is on in Python and in C.

| scenario | frames sent | double: frames that differ | single: measured signals that differ | most steps | single: chosen signals that differ | QEMU against the host's single build |
|---|---:|---:|---:|---:|---:|---:|
{chr(10).join(rows)}

A frame in which QEMU and the host differ comes from their libraries: newlib and glibc may round a sine to different neighbours.

## What it costs

Instructions of `ecu_tick` in `qemu-system-arm -icount shift=0`; times with {CLOCKS} clocks per instruction at {CLOCK_MHZ} MHz, an assumption. Of {len(costs[ON].instructions):,} cycles.

| | median | 99th percentile | most | stack | static memory and stack | code and constants |
|---|---:|---:|---:|---:|---:|---:|
{chr(10).join(cost_row(what, costs[option]) for option, what in BUILDS.items())}

The budget of code and constants is 131,072 B, of memory 32,768 B, of a cycle 10 ms. Of the code are {" and ".join(f"{parts[name]:,} B of `{name}`" for name in PARTS)}. On or off is decided when the ECU starts;
left out it is by `-DECU_WITHOUT_DETECTION` when the firmware is compiled.
""",
        encoding="utf-8",
    )
    print(options.out)


if __name__ == "__main__":
    main()
