"""How soon the machine is on its safe limits when something breaks: Python ECU and exported C program, page docs/results/safe-state.md.

scripts/uml-run .venv/bin/python -m bench.safe_state --out docs/results/safe-state.md
"""

import argparse
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from bench.safe_state.events import (
    BESIDE,
    BROKEN,
    CUT,
    EVENTS,
    HELD_UP_S,
    EcuProgram,
    Outcome,
    c_ecu,
    can_be_measured,
    measured,
    python_ecu,
)
from bench.safe_state.judge import judged
from bench.speed import commit
from deploy.c.project import write_project
from ecu.calibration import calibration_table, read_calibration

HEAD = """\
# Safe state when something breaks

Made by `scripts/uml-run .venv/bin/python -m bench.safe_state --times {times} --out docs/results/safe-state.md` at commit {commit}, on {kernel}.

A machine drives straight on at 14 km/h on its own CAN interface, by the limits of an ECU on another one; the kernel's can-gw joins them (a serial adapter of our own for the bus-off).
Its equipment declares that limits older than {declared:.0f} ms are replaced by its safe ones (8 km/h, 10°/s, 8 kN m per wheel). Times count from the event and are seen at the machine's ticks of 10 ms:
a tick that comes late, because the host is busy, is seen late. Each cell: median (largest).

*safe*: safe limits are in force. *slow*: 14 km/h have become the safe 8 km/h and the width over which the motors come to full retardation. *back*: after the ECU is started or its interface is there again, its limits are in force again.

| ECU | event | safe [ms] | declared and one late tick [ms] | in time | slow [s] | back [s] |
|---|---|---:|---:|---|---:|---:|
"""
BESIDE_HEAD = """
What must not reach the machine: a recorder beside the ECU whose disk (256 KiB) is full, a clock that is set an hour on and back, and nothing at all, which shows what the host itself does. All share one processor. Where the
machine's own ticks were {held_up:.0f} ms apart, its inputs are stale, and safe limits answer to that: these times are not held against the event. The recorder's disk is judged from its first written byte on.

| ECU | event | times with safe limits | of them with the machine on time | longest gap of `Limits` [ms] | longest gap of the machine's ticks [ms] | exit code of what had to end |
|---|---|---:|---:|---:|---:|---|
"""
BROKEN_HEAD = """
An ECU that is started with a broken configuration: the Python ECU with a calibration that holds a text for a number, the C program with a priority that does not exist.

| ECU | frames sent | exit code | safe [ms after the machine's first tick] |
|---|---:|---|---:|
"""


def cell(values: Sequence[float | None], scale: float, digits: int) -> str:
    """Median (largest); a dash where there is none."""
    known = [value * scale for value in values if value is not None]
    return f"{median(known):.{digits}f} ({max(known):.{digits}f})" if known else "–"


def page(
    found: Mapping[tuple[str, str], Sequence[Outcome]], times: int, kernel: str, at: str | None = None
) -> str:
    """The page of all outcomes. at: the commit, by default that of the checkout."""
    first = next(iter(found.values()))[0]
    lines = [
        HEAD.format(times=times, commit=at or commit()[0], kernel=kernel, declared=first.declared_s * 1e3)
    ]
    for (ecu, event), outcomes in found.items():
        if event in CUT:
            safe = cell([o.safe_after_s for o in outcomes], 1e3, 0)
            bound = cell([o.declared_s + o.late_s for o in outcomes], 1e3, 0)
            slow, back = (
                cell(values, 1.0, 2)
                for values in ([o.slow_after_s for o in outcomes], [o.back_after_s for o in outcomes])
            )
            well = sum(judged(event, o) == [] for o in outcomes)
            lines.append(
                f"| {ecu} | {event} | {safe} | {bound} | {well} of {len(outcomes)} | {slow} | {back} |\n"
            )
    lines.append(BESIDE_HEAD.format(held_up=HELD_UP_S * 1e3))
    for (ecu, event), outcomes in found.items():
        if event in BESIDE:
            gap, late = (
                cell(values, 1e3, 0)
                for values in ([o.longest_gap_s for o in outcomes], [o.late_s for o in outcomes])
            )
            reached = sum(o.safe_after_s is not None for o in outcomes)
            codes = ", ".join(sorted({str(o.exit_code) for o in outcomes if o.exit_code is not None})) or "–"
            unforced = sum(o.unforced_s is not None for o in outcomes)
            lines.append(
                f"| {ecu} | {event} | {reached} of {len(outcomes)} | {unforced} | {gap} | {late} | {codes} |\n"
            )
    lines.append(BROKEN_HEAD)
    for (ecu, event), outcomes in found.items():
        if event in BROKEN:
            codes = ", ".join(sorted({str(o.exit_code) for o in outcomes}))
            safe = cell([o.safe_after_s for o in outcomes], 1e3, 0)
            lines.append(f"| {ecu} | {sum(o.frames for o in outcomes)} | {codes} | {safe} |\n")
    fewer = [
        f"{ecu}, {event}: {len(found.get((ecu, event), ()))}"
        for event in EVENTS
        for ecu in ("python", "c")
        if len(found.get((ecu, event), ())) < times
    ]
    if fewer:
        lines.append(
            f"\nThe aim was {times} times each. This host was too busy for all of them; measured were: {'; '.join(fewer)}.\n"
        )
    return "".join(lines)


def at_last(ecu: EcuProgram, event: str, tries: int = 2) -> Outcome | None:
    """An outcome; None on a host so busy that the ECU never drives the machine for half a second, however often it is asked."""
    for left in reversed(range(tries)):
        try:
            return measured(ecu, event)
        except TimeoutError as error:
            print(f"not measured, {left} tries left: {error}", flush=True)
    return None


def main() -> int:
    """Measure everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--times", type=int, default=5)
    chosen = parser.parse_args()
    if not can_be_measured():
        print(
            "this is no user-mode Linux, whose clock and disks are its own: scripts/uml-run COMMAND",
            file=sys.stderr,
        )
        return 2
    kernel = f"Linux {platform.release()} as a process (user-mode Linux, one processor)"
    found: dict[tuple[str, str], list[Outcome]] = {}
    with tempfile.TemporaryDirectory() as folder:
        table = calibration_table("l60")
        write_project(Path(folder) / "c", read_calibration(table), table.values)
        subprocess.run(["make", "-s", "-C", f"{folder}/c"], check=True)
        ecus = (python_ecu(Path(folder)), c_ecu(Path(folder) / "c/linux/loader-ecu"))
        for event in EVENTS:
            for ecu in ecus:
                for _ in range(chosen.times):
                    outcome = at_last(ecu, event)
                    if outcome is None:
                        break
                    found.setdefault((ecu.name, event), []).append(outcome)
                    print(ecu.name, event, outcome, *judged(event, outcome), flush=True)
                    # after each: a run of half an hour that is ended early leaves a page
                    chosen.out.write_text(page(found, chosen.times, kernel), encoding="utf-8")
    print(f"written: {chosen.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
