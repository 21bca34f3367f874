"""Several faults that come and go: two effects of the library, each in one or two intervals of a drive of five minutes.

    python -m bench.switched [--cases 40] [--first 500000] [--out docs/results/switched.md]

Sizes give a lambda of 2500 to an effect that acts throughout. A fault is found if a named group has it; the overlap of its intervals is that of what is
reported and what was true, in seconds (intersection over union), and 0 for a fault that was not found.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.proof import report
from bench.proof.arm import Arm
from bench.proof.score import Share
from bench.proof.straight import STRAIGHT
from bench.proof.straight_truth import WHITE, record
from discrepancy.examine import examine
from discrepancy.models.straight import MASS_KG, model
from discrepancy.selection.state import Settings

EFFECTS = STRAIGHT.intervals
DURATION_S = 300.0
LAMBDA = 2500.0
SHORTEST_S, LONGEST_S = 40.0, 70.0  # of an interval; a window of the model has 8 s
FOUND, OVERLAP = 0.85, 0.7  # aims

Spells = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a case, and what was reported of it."""

    effect: str
    true: Spells
    named: bool
    reported: Spells

    @property
    def overlap(self) -> float:
        """Intersection over union of the intervals [s]."""
        if not self.named:
            return 0.0
        grid = np.arange(0.0, DURATION_S, 0.1)
        true, seen = (_inside(grid, spells) for spells in (self.true, self.reported))
        return float(np.sum(true & seen) / np.sum(true | seen))


@dataclass(frozen=True, slots=True)
class Case:
    """One drive."""

    seed: int
    faults: Sequence[Fault]
    false: Sequence[str]  # names that are neither of the faults
    status: str


def _inside(grid: np.ndarray, spells: Spells) -> np.ndarray:
    return np.any(
        [(grid >= start) & (grid < end) for start, end in spells] or [np.zeros(grid.size, bool)], axis=0
    )


def spells(rng: np.random.Generator) -> list[tuple[float, float]]:
    """One or two intervals of time, some 20 s apart at least, away from the ends of the drive."""
    lengths = rng.uniform(SHORTEST_S, LONGEST_S, int(rng.integers(1, 3)))
    free = DURATION_S - 40.0 - float(np.sum(lengths)) - 20.0 * (lengths.size - 1)
    gaps = np.sort(rng.uniform(0.0, free, lengths.size))
    starts = 20.0 + gaps + np.concatenate([[0.0], np.cumsum(lengths[:-1] + 20.0)])
    return [(float(a), float(a + length)) for a, length in zip(starts, lengths, strict=True)]


def carried_out(seed: int) -> Case:
    """Size two effects, record them in their intervals, diagnose."""
    rng = np.random.default_rng([seed, 7])
    library = {effect.name: effect for effect in model().effects}
    names = [str(name) for name in rng.choice(EFFECTS, 2, replace=False)]
    arm = Arm(body="straight", kind="effect", seed=seed, noise="white", strength=LAMBDA)
    truth, times = dict[str, float](), dict[str, list[tuple[float, float]]]()
    for name in names:
        truth |= STRAIGHT.sized(library[name], arm).values
        times |= dict.fromkeys(library[name].names, spells(rng))
    machine = {"mass": MASS_KG * (1.0 + 0.03 * rng.normal()), "viscous": 400.0}
    recording = record({**machine, **truth}, WHITE, rng, duration_s=DURATION_S, intervals=times)
    found = examine(model(), [recording], Settings())
    faults = []
    for name in names:
        mine = [f for f in found.findings if f.named and name in f.members]
        where = [(i.start_s, i.end_s) for f in mine for i in f.where.intervals]
        if mine and mine[0].where.throughout:
            where = [(0.0, DURATION_S)]
        faults.append(Fault(name, times[library[name].names[0]], bool(mine), where))
    right = set(names)
    false = [f.effect for f in found.findings if f.named and not right & {*f.members}]
    return Case(seed, faults, false, found.status)


def page(cases: Sequence[Case], command: str, commit: str) -> Iterator[str]:
    """The page of Markdown, line by line."""
    faults = [fault for case in cases for fault in case.faults]
    hits = Share(sum(f.named for f in faults), len(faults))
    overlaps = [f.overlap for f in faults]
    yield from (
        "# Faults that come and go",
        "",
        f"`{command}`, commit {commit}.",
        "",
        *(line for line in (__doc__ or "").split("\n\n")[-1].strip().split("\n")),
        "",
        "| metric | target | measured |",
        "|---|---|---|",
        f"| faults in a named group | >= {FOUND:.0%} | {hits}{'' if hits.hits >= FOUND * hits.of else ' **missed**'} |",
    )
    for count in (1, 2):
        some = [f for f in faults if len(f.true) == count]
        yield f"| of these with {count} interval{'s' if count > 1 else ''} | | {Share(sum(f.named for f in some), len(some))} |"
    middle = float(np.median(overlaps))
    yield f"| overlap of the intervals, median | >= {OVERLAP} | {middle:.2f}{'' if middle >= OVERLAP else ' **missed**'} |"
    yield f"| overlap of those found, quartiles | | {', '.join(f'{q:.2f}' for q in np.quantile([f.overlap for f in faults if f.named] or [0.0], (0.25, 0.5, 0.75)))} |"
    yield f"| recordings with a false name | | {Share(sum(bool(c.false) for c in cases), len(cases))} |"
    yield from (
        "",
        "| seed | fault | true [s] | found [s] | overlap | false names | verdict |",
        "|---|---|---|---|---|---|---|",
    )
    for case in cases:
        for fault in case.faults:
            seen = _text(fault.reported) if fault.named else "not named"
            yield (
                f"| {case.seed} | {fault.effect} | {_text(fault.true)} | {seen} | {fault.overlap:.2f} "
                f"| {', '.join(case.false)} | {case.status} |"
            )


def _text(times: Spells) -> str:
    return ", ".join(f"{start:.0f} to {end:.0f}" for start, end in times)


def main() -> None:
    """Carry out all cases and print or write the page."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.switched",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument(
        "--first",
        type=int,
        default=500_000,
        help="first seed; others than those of the page are for changes of rules",
    )
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--out", type=Path, default=None)
    args = parser.parse_args()
    with ProcessPoolExecutor(args.workers) as pool:
        cases = list(pool.map(carried_out, range(args.first, args.first + args.cases)))
    text = (
        "\n".join(
            page(
                cases, f"python -m bench.switched --cases {args.cases} --first {args.first}", report.commit()
            )
        )
        + "\n"
    )
    report.publish(text, args.out)


if __name__ == "__main__":
    main()
