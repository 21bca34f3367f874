"""Random frames through the exported C on a Cortex-M4F in QEMU, in single precision, against the Python ECU: docs/results/microcontroller-random.md.

    python -m bench.microcontroller_random --frames 1000000

Drives with noisy, wild and damaged frames, and frames of random bits; the detection of sensor faults is on. Estimates and choices are
judged as `bench.single_precision` says.
"""

import argparse
import tempfile
import time
from pathlib import Path

from bench.microcontroller import CLOCK_MHZ, CLOCKS, Builds, Calls, Sent, answers
from bench.microcontroller_detection import ON, built, replayed
from bench.single_precision import NEAR, Judged, choice_rows, difference_of, estimate_rows, estimates
from bench.speed import commit
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from tests.deploy.c.random_drives import RandomDrive, random_frames

DRAWS = 8
"""Builds with rounding by chance that each drive is compared with, unless --draws says otherwise."""
FRAMES = 10_000
"""Of one drive. The ECU starts anew for each: what follows from another choice ends with its drive."""
OF_BITS = 10
"""One drive in so many has frames of random bits alone."""
TOGETHER = 10
"""Drives that go through QEMU in one run."""


def calls_of(seed: int) -> Calls:
    """One drive."""
    if seed % OF_BITS == OF_BITS - 1:
        return list(random_frames(seed, FRAMES))
    return list(RandomDrive(load_calibration(), seed).calls(FRAMES))


def sent_by_python(calls: Calls) -> Sent:
    """What the Python ECU sends in it."""
    ecu, sent = EcuCycle(load_calibration(), detect_faults=True), []
    for frame, now in calls:
        if frame is not None:
            ecu.receive(frame, now)
        else:
            sent.append([(f.can_id, bytes(f.data)) for f in ecu.tick(now).frames])
    return sent


def judged_together(builds: Builds, seeds: range, done: Judged, instructions: list[int], draws: int) -> int:
    """Some drives through QEMU in one run, and each through Python and the draws; how many of the frames sent QEMU and the host make otherwise."""
    drives = [calls_of(seed) for seed in seeds]
    board = replayed(builds.c, ON, *drives)
    instructions += board.instructions
    unlike = first = 0
    for seed, calls in zip(seeds, drives, strict=True):
        expected = sent_by_python(calls)
        found = board.ticks[first : first + len(expected)]
        first += len(expected)
        host = answers(builds.single, calls, detects=True)
        unlike += sum(
            a != b
            for ours, theirs in zip(found, host, strict=True)
            for a, b in zip(ours, theirs, strict=True)
        )
        drawn = [
            difference_of(answers(builds.perturbed, calls, 1000 * seed + k, detects=True), expected)
            for k in range(draws)
        ]
        done.add(len(expected), difference_of(found, expected), drawn)
    assert first == len(board.ticks)
    return unlike


def page(done: Judged, frames: int, unlike: int, instructions: list[int], draws: int, took_s: float) -> str:
    """The whole page."""
    revision, clean = commit()
    most = max(instructions)
    of_estimates, alone = done.counts(estimates())
    of_choices, alone_choices = done.counts(done.choices())
    compared = done.ticks * len(list(estimates()))
    return f"""# Random frames in single precision on a Cortex-M4F

Commit {revision}{"" if clean else " (with changes)"}; `python -m bench.microcontroller_random --frames {frames} --draws {draws}`, {took_s / 60:.0f} minutes. Words and method as in [the ECU in C](microcontroller.md), reasons in [decision 63](../adr/0063-random-frames-in-single-precision.md).

{done.drives} drives of {FRAMES:,} frames, {done.ticks:,} cycles, go through `qemu-system-arm` and through the Python ECU; the detection of sensor faults is on in both. Nine of ten are drives with noisy and wild signals and bursts of trouble
(frames lost, late, doubled, swapped, cut, damaged, or of random bits and signed; sensors that stand still or report a fault), one of ten is random bits, mostly signed, at times that jump and run backwards. The ECU starts anew for each.

## The rule

- An estimate is within one step of its signal of what Python sends. A choice (validity, warning, state, trouble code, a limit, the end of a prediction) is Python's.
- It may be otherwise only where rounding decides, at a threshold: one of {draws} builds in double precision whose every result is changed at random by the rounding of single precision (a *draw*) is then beyond the same bound, within {NEAR / 100:g} s of the stretch of cycles.
  The thresholds are also those of choices that no signal shows: whether the detection replaces a sample, whether a tyre is in contact.

## Estimates

Of some {compared:,} values sent, those beyond their bound lie in {of_estimates:,} stretches; {alone:,} of these have no draw that is beyond it too.

| estimate | bound | frames off within it | beyond it | stretches | without a draw beyond it |
|---|---:|---:|---:|---:|---:|
{chr(10).join(estimate_rows(done))}

## Choices

In {of_choices:,} stretches a choice differs from Python's. In {alone_choices:,} of them no draw differs from it.

| choice | frames in which it differs | stretches | without a draw that differs |
|---|---:|---:|---:|
{chr(10).join(choice_rows(done))}

{unlike:,} frames of QEMU differ from those of the host's single-precision build: newlib and glibc round a sine to different neighbours. The most costly cycle took {most:,} instructions ({most * CLOCKS / CLOCK_MHZ / 1e3:.1f} of 10 ms, as estimated on [the page of costs](microcontroller.md)).
"""


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/results/microcontroller-random.md"))
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--draws", type=int, default=DRAWS)
    options = parser.parse_args()
    started, done, instructions, unlike = time.monotonic(), Judged(), [], 0
    with tempfile.TemporaryDirectory() as folder:
        builds = Builds(Path(folder))
        built(builds.c, ON)
        for first in range(0, options.frames // FRAMES, TOGETHER):
            seeds = range(first, min(first + TOGETHER, options.frames // FRAMES))
            unlike += judged_together(builds, seeds, done, instructions, options.draws)
            for name, found in done.signals.items():
                if alone := [place for place in found.alone if place[0] >= first]:
                    print(name, found.stretches, alone, flush=True)
            text = page(done, options.frames, unlike, instructions, options.draws, time.monotonic() - started)
            options.out.write_text(text, encoding="utf-8")
            print(f"{done.drives} drives after {time.monotonic() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
