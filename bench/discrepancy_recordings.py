"""Diagnose the public recordings with the effect concealed: `python -m bench.discrepancy_recordings FOLDER [--out FILE]`."""

import argparse
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from discrepancy.examine import examine
from discrepancy.findings import Findings
from discrepancy.model import Model
from discrepancy.models import ball, car, road
from discrepancy.recording import Recording
from discrepancy.search import Settings

BALLS = ("Tennis Ball", "Whiffle Ball 1", "Whiffle Ball 2", "Yellow Whiffle Ball", "Orange Whiffle Ball")
HEAVY = ("Bowling Ball", "Golf Ball", "Baseball", "Blue Basketball", "Green Basketball")


FROM_THE_COMMAND_LINE = (
    "",
    "Each of them from the command line:",
    "",
    '    loaderhil diagnose FOLDER/ball_drops --model ball --part "Tennis Ball" --out out/ball',
    "    loaderhil diagnose FOLDER/dart_rc_car/rubber_free_mid_100228.csv.gz --model car --out out/car",
    "    loaderhil diagnose FOLDER/dart_rc_car/rubber_free_mid_100228.csv.gz --model car --part on-board --out out/car",
    "    loaderhil diagnose FOLDER/comma2k19_rav4 --model road --out out/road",
)


def timed(model: Model, recording: list[Recording]) -> tuple[Findings, float]:
    start = time.perf_counter()
    return examine(model, recording, Settings()), time.perf_counter() - start


def shown(result: Findings) -> str:
    """Findings in one cell."""
    cells = []
    for f in result.findings:
        e = f.parameters[0]
        value = (
            f"{len(f.parameters)} knots"
            if len(f.parameters) > 3
            else f"{e.value:.3g} [{e.low:.3g}, {e.high:.3g}] {'' if e.unit == '1' else e.unit}".strip()
        )
        group = f" (or {', '.join(m.effect for m in f.group)})" if f.group else ""
        cells.append(f"{'' if f.named else 'proxy: '}{f.effect} {value}{group}")
    return "; ".join(cells) or "none"


def rows(folder: Path) -> Iterator[str]:
    def row(recording: str, expected: str, result: Findings, seconds: float) -> str:
        remainder = result.open_ended.equation.replace("|", "\\|") if result.open_ended else "-"
        return (
            f"| {recording} | {expected} | {result.status} | {shown(result)} | {remainder} | {seconds:.1f} |"
        )

    for name in (*BALLS, *HEAVY):
        expected = "drag, cd 0.46-0.69" if name in BALLS else "no finding"
        yield row(name, expected, *timed(ball.model(), ball.load_drops(folder / "ball_drops", name)))
    for path in sorted((folder / "dart_rc_car").glob("*.csv.gz")):
        name = path.name.removesuffix(".csv.gz")
        expected = "gyro delay 0.09-0.10 s, scale 1.03; encoder 0.11-0.21 s; servo lag 0.075-0.105 s"
        yield row(f"{name}, with Vicon", expected, *timed(car.model(), [car.load_dart(path)]))
        on_board = car.load_dart(path, reference=False)
        yield row(f"{name}, on board only", "a delay, shared", *timed(car.model(reference=False), [on_board]))
    drive = road.load_comma(folder / "comma2k19_rav4")
    result, seconds = timed(road.model([drive]), [drive])
    yield row("RAV4, segment 40", "road grade, ACCEL_X reversed", result, seconds)
    yield f"\nRAV4: {grade_against_pose(folder / 'comma2k19_rav4', drive, result)}"


def grade_against_pose(folder: Path, drive: Recording, result: Findings) -> str:
    """The grade found against the concealed pose: slope of a regression, R²."""
    with np.load(folder / "segment40.npz") as arrays:
        velocity, time_s = arrays["global_pose_frame_velocities"], arrays["global_pose_frame_times"]
        latitude, longitude = np.radians(arrays["GNSS_live_gnss_ublox_value"][0, :2])
    up = np.array(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    true = np.arcsin(velocity @ up / np.linalg.norm(velocity, axis=1))
    knots = [e.value for e in result.finding("road grade").parameters]
    driven = drive.signals["distance"]
    at = np.interp(time_s, driven.time_s, driven.value)
    found = np.interp(at, road.KNOT_M * np.arange(len(knots)), knots)
    slope = float(np.polyfit(found, true, 1)[0])
    return f"pose = {slope:.3f} x grade found, R² {np.corrcoef(found, true)[0, 1] ** 2:.3f} (expected 0.996; 0.715 to 0.912)."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="folder with ball_drops, dart_rc_car and comma2k19_rav4")
    parser.add_argument("--out", type=Path, default=None)
    args = parser.parse_args()
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    text = "\n".join(
        [
            "# Discrepancy engine on recordings of real things",
            "",
            f"`python -m bench.discrepancy_recordings FOLDER`, commit {commit.stdout.strip()}. Values with 95 % intervals;"
            " 'proxy' is what the engine itself does not name as the cause; the remainder is what the library leaves.",
            "",
            "| recording | expected | status | findings | remainder | s |",
            "|---|---|---|---|---|---|",
            *rows(args.folder),
            *FROM_THE_COMMAND_LINE,
        ]
    )
    if args.out:
        args.out.write_text(text + "\n")
    else:
        print(text)


if __name__ == "__main__":
    main()
