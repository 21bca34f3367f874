"""Coverage of the identification on seeded recordings with every defect on: one line per case, then a report.

    python -m bench.identify_coverage --cases 200 --out docs/results/identification.md

Cases are kept in a file as they end, with the state of the sources that made them: an interrupted run is taken up where it was, and cases of
other sources are run again. The report is written again after every ten cases.
"""

import argparse
import json
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from identify.field.chain import processed
from identify.field.fit import fit_points
from identify.make.field import make_field
from identify.make.rig import make_rig
from identify.rig.chain import fitted, inconsistent_runs, prepare
from identify.tyre.parameters import COMBINED, curve, vector
from identify.tyre.rig_problem import CARCASS_NAME
from plant.sheets.machine import Machine, load_machine

JUDGED = ("PKX1", "PDX1", "PCX1", "PEX1", "PDX2", "PPX1", "PPX3", CARCASS_NAME)

WANTED, AIM = 200, 0.93  # cases of each arm, and the share of them whose interval should hold the truth


def any_machine(seed: int) -> Machine:
    """The l60 on random tyres, so that a fit cannot depend on the values of one tyre."""
    # 7: a stream apart from those of the recordings, which begin with the seed alone
    machine, random = load_machine("l60"), np.random.default_rng([seed, 7])
    ranges = {
        "pkx1": (5.0, 12.0), "pcx1": (1.25, 1.65), "pdx1": (0.6, 0.95), "pex1": (-1.0, 0.6), "pdx2": (-0.1, 0.05), "pkx3": (-0.2, 0.0),
        "ppx1": (-0.5, -0.1), "ppx3": (-0.15, 0.0), "longitudinal_stiffness": (0.4e6, 1.2e6),
        "rbx1": (7.0, 16.0), "rbx2": (5.0, 16.0), "rcx1": (0.85, 1.0), "rex1": (-1.0, 0.2),
    }  # fmt: skip
    return replace(
        machine, tyre=replace(machine.tyre, **{name: random.uniform(*r) for name, r in ranges.items()})
    )


def rig_case(seed: int) -> dict:
    """One log of a rig: whether each truth lies in its interval, and the relaxation length at small slip for three loads."""
    started = time.process_time()
    log, truth = make_rig(any_machine(seed), seed)
    ready = prepare(log)
    made = time.process_time()
    found = fitted(ready)
    true = {**truth.tyre, CARCASS_NAME: truth.carcass_stiffness}
    row: dict = {
        "arm": "rig",
        "seed": seed,
        "seconds": time.process_time() - made,
        "making_s": made - started,
        "unusable": list(ready.unusable),
        "inconsistent_runs": len(inconsistent_runs(ready, found)),
    }
    for name in JUDGED:
        i = found.interval(name)
        row[name] = [
            true[name],
            i.value,
            i.lower,
            i.upper,
            found.bootstrap_sd(name, np.random.default_rng(0)),
        ]
    lengths = []
    for load in (27e3, 34e3, 48e3):
        stiffness = [
            curve(vector(v), log.nominal, load, log.nominal.pressure)[0][0]
            for v in (truth.tyre, {n: found.values[n] for n in found.names if n in truth.tyre})
        ]
        lengths.append(
            (stiffness[1] / found.values[CARCASS_NAME]) / (stiffness[0] / truth.carcass_stiffness) - 1.0
        )
    # length = slip stiffness over carcass stiffness: both are estimated, and errors of both can cancel or add
    row["relaxation"] = lengths
    return row


def field_case(seed: int, arm: str = "field", slip_angle: float = 0.0) -> dict:
    """One field recording: whether each truth lies in its interval, and the largest error of the common clock [s]."""
    log, truth = make_field(any_machine(seed), seed, slip_angle=slip_angle)
    result = processed(log)
    _, found = fit_points(result)
    row: dict = {"arm": arm, "seed": seed, "lost": [list(result.sync.lost), truth.lost_event]}
    for name in (*JUDGED[:5], *(COMBINED if slip_angle else ())):
        i = found.interval(name)
        row[name] = [truth.tyre[name], i.value, i.lower, i.upper, 0.0]
    clock = np.linspace(0.0, float(log.somat.time[-1]), 50)
    row["sync_s"] = float(
        np.max(np.abs(result.sync.other(clock) - truth.offset - clock * (1.0 + truth.drift)))
    )
    return row


def combined_case(seed: int) -> dict:
    """The same with 16 further events at slip angles of up to 8°."""
    return field_case(seed, "field with slip angles", np.radians(8.0))


ARMS = {"rig": rig_case, "field": field_case, "field with slip angles": combined_case}


def report(rows: list[dict], command: str) -> str:
    """The text of the report: coverage with its own 95 % interval, per parameter."""
    out = [
        "# Coverage of the identification", "",
        f"`{command}`. Every case is another tyre and has every defect on.",
        "Coverage: share of cases whose 95 % interval holds the truth, with the 95 % interval of that share (Wilson). The aim is 93 % of 200 cases.", "",
    ]  # fmt: skip
    if short := [arm for arm in ARMS if sum(r["arm"] == arm for r in rows) < WANTED]:
        out += [
            f"Not yet {WANTED} cases: {', '.join(short)}. The intervals of the shares say how little is known so far.",
            "",
        ]
    for arm in ARMS:
        own = [r for r in rows if r["arm"] == arm]
        if not own:
            out += [f"## {arm}", "", "No case was run.", ""]
            continue
        out += [
            f"## {arm}: {len(own)} cases",
            "",
            f"Seeds from {min(r['seed'] for r in own)} to {max(r['seed'] for r in own)}, commit {own[0].get('commit', 'unknown')}.",
            "",
            "| parameter | inside | coverage | error (spread) | half width (mean) |",
            "|---|---|---|---|---|",
        ]
        below = []
        for name in (*JUDGED, *COMBINED):
            if name not in own[0]:
                continue
            # row: truth, value, lower, upper
            inside = sum(r[name][2] <= r[name][0] <= r[name][3] for r in own)
            below += [name] if inside < AIM * len(own) else []
            low, high = binomtest(inside, len(own)).proportion_ci(method="wilson")
            error = float(np.std([r[name][1] - r[name][0] for r in own]))
            half = float(np.mean([(r[name][3] - r[name][2]) / 2.0 for r in own]))
            out.append(
                f"| {name} | {inside} of {len(own)} | {inside / len(own):.1%} ({low:.0%} to {high:.0%}) | {error:.3g} | {half:.3g} |"
            )
        out += ["", f"Below the aim: {', '.join(below) or 'none'}."]
        if arm == "rig":
            lengths = np.abs([r["relaxation"] for r in own])
            out += [
                "",
                f"Relaxation length at small slip, three loads: largest error {lengths.max():.1%}; within 10 % in {np.mean(np.all(lengths < 0.1, axis=1)):.1%} of cases.",
            ]
            out.append(
                f"Processor: {np.median([r['seconds'] for r in own]):.1f} s per fit (median). Cases in which a run does not follow the fitted tyre: {sum(r['inconsistent_runs'] > 0 for r in own)}."
            )
        else:
            clocks = [r["sync_s"] for r in own]
            out += [
                "",
                f"Common clock: largest error {1e3 * max(clocks):.2f} ms, median {1e3 * float(np.median(clocks)):.2f} ms; a sample of the transducer is 2 ms.",
            ]
            out.append(
                f"The event that was not synchronised, and no other, was found in {sum(r['lost'][0] == [r['lost'][1]] for r in own)} of {len(own)} cases."
            )
        out.append("")
    return "\n".join(out)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first case")
    parser.add_argument("--arms", nargs="*", default=list(ARMS))
    parser.add_argument("--out", type=Path, default=Path("docs/results/identification.md"))
    parser.add_argument("--kept", type=Path, default=Path("out/identification.jsonl"))
    options = parser.parse_args()
    options.kept.parent.mkdir(parents=True, exist_ok=True)
    made_by, commit = _git("rev-parse", "HEAD:identify", "HEAD:plant"), _git("rev-parse", "--short", "HEAD")
    # only these two decide the figures; a changed document must not stop a run of hours
    if _git("status", "--porcelain", "--", "identify", "plant"):
        raise SystemExit(
            "identify/ or plant/ has changes that are not committed: a report must name its sources"
        )
    rows = (
        [json.loads(line) for line in options.kept.read_text().splitlines()] if options.kept.exists() else []
    )
    # rows of other sources stay in the file, and are not mixed with these; the report says of each arm what made it
    seeds = range(options.first, options.first + options.cases)
    rows = [
        row
        for row in rows
        if row["arm"] not in options.arms or (row.get("made_by") == made_by and row["seed"] in seeds)
    ]
    known = {(row["arm"], row["seed"]) for row in rows}

    def write() -> None:
        command = f"python -m bench.identify_coverage --cases {options.cases} --first {options.first}"
        options.out.write_text(report(rows, command), encoding="utf-8")

    with options.kept.open("a") as stream:
        for seed in seeds:
            for arm in options.arms:
                if (arm, seed) in known:
                    continue
                row = {**ARMS[arm](seed), "made_by": made_by, "commit": commit}
                rows.append(row)
                stream.write(json.dumps(row) + "\n")
                # a killed run keeps what it has measured
                stream.flush()
                if len(rows) % 10 == 0:
                    write()
    write()


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    main()
