"""How many intervals of `loaderhil identify machine` hold the truth: machines and sensors drawn from their priors, one drive each, into a page.

python -m bench.identify_machine --seeds 200 220 --out docs/results/identification-machine.md
"""

import argparse
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from discrepancy.model.description import Model
from discrepancy.models.loader import model as loader
from discrepancy.models.loader.channels import REFERENCE
from discrepancy.signals.recording import Recording
from identify.machine.drives import Identified, identified
from identify.machine.made import drawn, make_run
from identify.machine.parameters import identification_model
from identify.machine.profile import profiles
from plant.sheets.machine import load_machine

SCENARIO = "unloaded"
KINDS = ("with instruments", "machine's own bus")


@dataclass
class Tally:
    """Of one parameter over all seeds."""

    label: str
    machine: bool
    held: list[bool] = field(default_factory=list)
    remaining: list[float] = field(default_factory=list)
    away: list[float] = field(default_factory=list)  # error over its standard deviation
    determined: list[bool] = field(default_factory=list)


def build(recordings: Sequence[Recording]) -> Model:
    """The model of an identification."""
    return identification_model(loader.model(recordings))


def add(tallies: dict[str, Tally], found: Identified, truth: dict[str, float]) -> None:
    """One identification to the tallies."""
    for e in found.estimates:
        name = e.quantity.parameter
        tally = tallies.setdefault(name, Tally(e.quantity.label, e.quantity.kind == "machine"))
        tally.held.append(e.lower <= e.quantity.value(truth[name]) <= e.upper)
        tally.remaining.append(e.remaining)
        tally.away.append((found.values[name] - truth[name]) / found.sd(name))
        tally.determined.append(e.status == "determined")


def without_instruments(r: Recording) -> Recording:
    """The recording of the machine's own bus."""
    return replace(r, signals={name: s for name, s in r.signals.items() if name not in REFERENCE})


def share(tallies: list[Tally], *, determined: bool = False) -> str:
    """'263 of 280 (94 %)'."""
    held = [h for t in tallies for h, d in zip(t.held, t.determined, strict=True) if d or not determined]
    return f"{sum(held)} of {len(held)} ({sum(held) / max(len(held), 1):.0%})"


@dataclass
class Measured:
    """All tallies so far."""

    seeds: list[int] = field(default_factory=list)
    by_kind: dict[str, dict[str, Tally]] = field(default_factory=lambda: {kind: {} for kind in KINDS})
    inadequate: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    profiled: list[str] = field(default_factory=list)


def measure(seed: int, so_far: Measured, *, profile: bool) -> None:
    """One more machine."""
    machine, truth = load_machine("l60"), drawn(build([]), np.random.default_rng(seed))
    with tempfile.TemporaryDirectory(prefix="loaderhil-") as folder:
        run = loader.load_run(make_run(Path(folder) / str(seed), SCENARIO, seed, build([]), truth))
    for kind, recording in zip(KINDS, (run, without_instruments(run)), strict=True):
        found = identified(machine, build, [recording])
        add(so_far.by_kind[kind], found, truth)
        so_far.inadequate[kind] += bool(found.inadequate)
        if profile and kind == KINDS[0]:
            own = tuple(e.quantity.parameter for e in found.estimates if e.quantity.kind == "machine")
            so_far.profiled = [f"{n} {p.asymmetry:.0%}" for n, p in profiles(found, own).items()]
    so_far.seeds.append(seed)


def page(m: Measured, commit: str) -> str:
    """The whole page."""
    first, second = (m.by_kind[kind] for kind in KINDS)
    rows = [
        f"| {a.label} | {sum(a.held)}/{len(a.held)} | {np.mean(a.remaining):.2f} | {rms(a.away):.2f} | {sum(b.held)}/{len(b.held)} | {np.mean(b.remaining):.2f} | {rms(b.away):.2f} |"
        for a, b in ((first[n], second[n]) for n in first)
    ]
    totals = [
        f"| {what} | {share(a, determined=d)} | {share(b, determined=d)} |"
        for what, d, a, b in (
            ("all parameters", False, [*first.values()], [*second.values()]),
            ("all that are determined", True, [*first.values()], [*second.values()]),
            ("the machine's", False, [t for t in first.values() if t.machine], [t for t in second.values() if t.machine]),
            ("the machine's that are determined", True, [t for t in first.values() if t.machine], [t for t in second.values() if t.machine]),
        )
    ]  # fmt: skip
    count, begin, end = len(m.seeds), min(m.seeds), max(m.seeds) + 1
    return "\n".join([
        "# Machines from drives", "",
        f"`python -m bench.identify_machine --seeds {begin} {end}`, commit {commit}. {count} machines; masses, centres, inertias, stiffness, radius and all zero points and",
        "scales drawn from their priors (cut at two standard deviations), one drive `unloaded` of 40 s each. How many 95 % intervals hold the truth:", "",
        "| | with instruments | machine's own bus |", "|---|---|---|", *totals,
        f"| drives that the model does not describe | {m.inadequate[KINDS[0]]} of {count} | {m.inadequate[KINDS[1]]} of {count} |", "",
        "By parameter: intervals that hold, posterior over prior standard deviation (mean), root mean square of error over standard deviation.", "",
        "| parameter | holds | posterior/prior | error | holds, bus | posterior/prior, bus | error, bus |", "|---|---|---|---|---|---|---|", *rows, "",
        *([f"Profile likelihood beside the linearised interval, seed {begin}, largest difference of an end over half the interval: {', '.join(m.profiled)}.", ""] if m.profiled else []),
    ])  # fmt: skip


def rms(values: list[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs=2, type=int, default=(200, 220), metavar=("FIRST", "BEHIND"))
    parser.add_argument("--out", type=Path)
    parser.add_argument(
        "--profiled",
        type=int,
        default=1,
        help="first machines with profile likelihood too (a minute and a half each)",
    )
    arguments = parser.parse_args()
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    so_far = Measured()
    for number, seed in enumerate(range(*arguments.seeds)):
        measure(seed, so_far, profile=number < arguments.profiled)
        print(f"seed {seed}", flush=True)
        # after each machine: a killed measurement leaves those before
        if arguments.out:
            arguments.out.write_text(page(so_far, commit or "unknown"), encoding="utf-8")
    if not arguments.out:
        print(page(so_far, commit or "unknown"))


if __name__ == "__main__":
    main()
