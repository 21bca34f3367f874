"""Real recordings with a known cause: balls, a small car, a road vehicle's raw CAN, a tractor's traffic."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bench.exhibits import EXHIBITS, model_and_recordings
from bench.proof.arm import Arm, Truth, row
from dbc.recordings.reading import read_frames
from diagnosis.fleet.store import Row
from discrepancy.examine import examine
from discrepancy.model.description import Model
from discrepancy.models import ball, car, road
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording

VARIABLE = "LOADERHIL_DATA"
LIGHT = ("Tennis Ball", "Whiffle Ball 1", "Whiffle Ball 2", "Yellow Whiffle Ball", "Orange Whiffle Ball")
HEAVY = ("Bowling Ball", "Golf Ball", "Baseball", "Blue Basketball", "Green Basketball")
DART = "gyro delay 0.09-0.10 s, scale 1.03; encoder 0.11-0.21 s; servo lag 0.075-0.105 s"

Case = Callable[[Path], tuple[Model, list[Recording]]]


def folder() -> Path:
    """Where the public recordings are: $LOADERHIL_DATA, or ../shared/data beside the checkout."""
    return Path(os.environ.get(VARIABLE, Path(__file__).resolve().parents[3] / "shared" / "data"))


def cases(data: Path) -> dict[str, tuple[str, Case]]:
    """Name -> expected result, and a function that gives model and recordings."""
    found: dict[str, tuple[str, Case]] = {}
    for name in (*LIGHT, *HEAVY):
        expected = "drag, cd 0.46-0.69" if name in LIGHT else "no finding"
        found[name] = (
            expected,
            lambda data, name=name: (ball.model(), ball.load_drops(data / "ball_drops", name)),
        )
    for path in sorted((data / "dart_rc_car").glob("*.csv.gz")):
        name = path.name.removesuffix(".csv.gz")
        found[f"{name}, with Vicon"] = (DART, lambda _, path=path: (car.model(), [car.load_dart(path)]))
        found[f"{name}, on board only"] = (
            "a delay, shared",
            lambda _, path=path: (car.model(reference=False), [car.load_dart(path, reference=False)]),
        )
    for exhibit in EXHIBITS:
        if (data / exhibit.name).is_dir():
            found[exhibit.name.replace("_", " ")] = (
                exhibit.known,
                lambda data, exhibit=exhibit: model_and_recordings(exhibit, data),
            )
    found["RAV4, segment 40"] = ("road grade, ACCEL_X reversed", _rav4)
    return found


def _rav4(data: Path) -> tuple[Model, list[Recording]]:
    drive = road.load_comma(data / "comma2k19_rav4")
    return road.model([drive]), [drive]


def arms() -> Iterator[Arm]:
    """One per recording; none where there are no recordings."""
    for name in cases(folder()) if folder().is_dir() else ():
        yield Arm(body="real", kind="real", seed=0, what=name)


def carried_out(arm: Arm) -> Row:
    """Diagnose a recording; what it was concealed from the tool is compared afterwards."""
    data = folder()
    expected, case = cases(data)[arm.what]
    model, recordings = case(data)
    start = time.perf_counter()
    found = examine(model, recordings, Settings())
    seconds = time.perf_counter() - start
    beyond = {"expected": expected}
    if model.name == "road":
        beyond["pose"] = grade_against_pose(data / "comma2k19_rav4", recordings[0], found)
    return row(arm, Truth(beyond=beyond), found, seconds)


def grade_against_pose(segment: Path, drive: Recording, result: Findings) -> str:
    """The grade found against the concealed pose: slope of a regression, R²."""
    if "road grade" not in [f.effect for f in result.findings]:
        return "no grade found"
    with np.load(segment / "segment40.npz") as arrays:
        velocity, time_s = arrays["global_pose_frame_velocities"], arrays["global_pose_frame_times"]
        latitude, longitude = np.radians(arrays["GNSS_live_gnss_ublox_value"][0, :2])
    # the local vertical in Earth-fixed axes, in which comma's poses are given
    up = np.array(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    # grade: climb over way, both from the pose
    true = np.arcsin(velocity @ up / np.linalg.norm(velocity, axis=1))
    knots = [e.value for e in result.finding("road grade").parameters]
    driven = drive.signals["distance"]
    at = np.interp(time_s, driven.time_s, driven.value)
    found = np.interp(at, road.KNOT_M * np.arange(len(knots)), knots)
    # 1 if both are of one size; R² says whether they have one shape
    slope = float(np.polyfit(found, true, 1)[0])
    return f"concealed pose = {slope:.3f} x grade found, R² {np.corrcoef(found, true)[0, 1] ** 2:.3f} (0.996; 0.715 to 0.912)"


def decoded_traffic(data: Path) -> str:
    """How much of the tractor's traffic is read: frames, identifiers, damaged lines."""
    counts = []
    for log in sorted((data / "tractorhacking_j1939").glob("*.log")):
        frames = read_frames(log)
        counts.append(f"{log.name.partition('.')[0]} {len(frames)} ({frames.damaged_count} damaged)")
    return f"A tractor's J1939 traffic, frames read: {', '.join(counts)}." if counts else ""
