"""The next experiment on four drives that leave several names: which manoeuvre is chosen, and what the diagnosis of both drives says.

    python -m bench.next_experiment --out docs/results/next-experiment.md

Each case hides one effect in the bench, drives it with the sensors of a machine in service, and leaves everything else to `loaderhil experiment --sealed FILE`.
The expected evidence is the choice's own prediction; what the diagnosis of both drives then finds is measured.
"""

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.proof import report
from diagnosis.blind.hidden import Truth
from diagnosis.blind.hidden_run import concealed_run
from diagnosis.blind.seal import seal
from hil.compose import Choice
from hil.rundir import REFERENCE

STRAIGHT = """
name = "drive"
sentence = "Straight ahead at 10 km/h with an empty bucket."
duration_s = 24.0
machine = "l60"
seed = {seed}
[start]
speed_kmh = 10.0
[driver.speed_kmh]
points = [[0.0, 10.0], [8.0, 10.0], [9.0, 11.0], [16.0, 11.0], [17.0, 10.0]]
"""
WINDING = """
name = "drive"
sentence = "Slow turns to the left and to the right at 8 km/h with an empty bucket."
duration_s = 30.0
machine = "l60"
seed = {seed}
[start]
speed_kmh = 8.0
[driver.speed_kmh]
points = [[0.0, 8.0], [30.0, 8.0]]
[driver.articulation_deg]
points = [[0.0, 0.0], [4.0, 0.0], [8.0, 12.0], [12.0, 12.0], [18.0, -12.0], [22.0, -12.0], [26.0, 0.0], [30.0, 0.0]]
"""
MOST = 3
"""Manoeuvres of a case."""
FINISHED = (0, 1, 5)
"""Exit codes of `loaderhil experiment`: every finding has one name; something is left that nothing distinguishes; another manoeuvre is proposed."""


@dataclass(frozen=True, slots=True)
class Case:
    """One hidden effect, and a drive in which another would do as well."""

    effect: str
    values: Mapping[str, float]  # by parameter, in its unit
    drive: str
    why: str  # the group


CASES = (
    Case(
        "brake_drag",
        {"brake_drag.front_N_m": 400.0, "brake_drag.rear_N_m": 400.0},
        STRAIGHT,
        "at one load and one speed, brakes that drag and tyres that resist rolling are the same torque",
    ),
    Case(
        "rolling_resistance",
        {"rolling_resistance.coefficient": 0.02, "rolling_resistance.growth_per_m_per_s": 0.0},
        STRAIGHT,
        "the same group, and the other of the two is true",
    ),
    Case(
        "pitch_angle delay",
        {"pitch_angle.delay": 0.05},
        STRAIGHT,
        "while the machine hardly pitches, an inclination sensor that is late and one that lags read the same",
    ),
    Case(
        "roll_angle lag",
        {"roll_angle.lag": 0.1},
        WINDING,
        "in slow turns on level ground the machine rolls too slowly to tell an inclination sensor that lags from one that is late",
    ),
)


def carried_out(case: Case, seed: int, folder: Path) -> dict[str, Any]:
    """What `loaderhil experiment` wrote of one case."""
    scenario = folder / "drive.toml"
    scenario.write_text(case.drive.format(seed=seed), encoding="utf-8")
    truth, run = Truth(model="loader", seed=seed, effects={case.effect: dict(case.values)}), folder / "run"
    concealed_run(Choice(scenario=str(scenario)), truth, run)
    # a machine in service has no force plates
    (run / REFERENCE).unlink()
    sealed = folder / "truth.sealed"
    sealed.write_text(seal(truth, [run]), encoding="utf-8")
    experiment = [sys.executable, "-m", "loaderhil", "experiment", str(run), "--model", "loader"]
    options = ["--sealed", str(sealed), "--most", str(MOST), "--out", str(folder / "next")]
    ended = subprocess.run([*experiment, *options], check=False)
    if ended.returncode not in FINISHED:
        raise SystemExit(f"{case.effect}: `loaderhil experiment` ended with {ended.returncode}")
    document: dict[str, Any] = json.loads((folder / "next" / "experiment.json").read_text(encoding="utf-8"))
    return document


def page(results: Sequence[tuple[Case, int, dict[str, Any]]], command: str, version: str) -> Iterator[str]:
    """The page of Markdown, line by line."""
    yield from (
        "# The next experiment",
        "",
        f"`{command}`, commit {version}.",
        "",
        *(__doc__ or "").split("\n\n")[-1].strip().split("\n"),
        "",
        "| hidden | why one drive is not enough | seed | round | verdict | next manoeuvre | expected evidence |",
        "|---|---|---:|---:|---|---|---|",
    )
    for case, seed, document in results:
        for one in document["rounds"]:
            names = "; ".join(" or ".join((f["effect"], *f["group"])) for f in one["findings"] if f["named"])
            chosen = next((m for m in one["manoeuvres"] if m["name"] == one["chosen"]), None)
            yield (
                f"| {case.effect} | {case.why} | {seed} | {one['round']} | {one['status']}: {names or 'no name'} "
                f"| {one['chosen'] or ('none needed' if one['resolved'] else 'none decides')} | {_evidence(chosen)} |"
            )


def _evidence(manoeuvre: dict[str, Any] | None) -> str:
    """The pairs that a manoeuvre would distinguish, with twice the logarithm of the likelihood ratio that is expected."""
    pairs = manoeuvre["expected"] if manoeuvre else []
    return "; ".join(f"{e['one']} against {e['other']}: {e['difference']:.0f}" for e in pairs) or "-"


def main() -> None:
    """Carry out all cases and print or write the page."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.next_experiment",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--first", type=int, default=700, help="seed of the first case")
    parser.add_argument("--cases", default="", help="effects, by comma; default: all")
    parser.add_argument("--out", type=Path, default=None, help="write the page here, else print it")
    args = parser.parse_args()
    wanted = [name for name in args.cases.split(",") if name]
    results = []
    for number, case in enumerate(CASES):
        if wanted and case.effect not in wanted:
            continue
        with tempfile.TemporaryDirectory(prefix="loaderhil-next-") as folder:
            results.append((case, args.first + number, carried_out(case, args.first + number, Path(folder))))
    chosen = f" --cases {shlex.quote(args.cases)}" if wanted else ""
    command = f"python -m bench.next_experiment --first {args.first}{chosen}"
    text = "\n".join(page(results, command, report.commit())) + "\n"
    report.publish(text, args.out)


if __name__ == "__main__":
    main()
