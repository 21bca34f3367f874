"""Grip on two floors, steering lag and sensor delays of a small car from public recordings (DART, TU Delft), into a page.

python -m bench.identify_car DATA/dart_rc_car --out docs/results/identification-car.md
"""

import argparse
import subprocess
from pathlib import Path

from identify.car.fits import grip, sensor_delay, steering_lag
from identify.car.log import Car, read_car
from identify.car.motion import body_motion
from identify.tyre.estimate import Estimate

DRIVES = (
    ("rubber_ramp_steer+0.25.csv.gz", "rubber", "front"),
    ("tape_circles_steer-0.3.csv.gz", "tape", "front"),
    ("rubber_free_mid_100228.csv.gz", "rubber", "rear"),
    ("rubber_free_fast_101205.csv.gz", "rubber", "rear"),
)
"""Recording, floor, and the axle that grip is found at: the front one where the steering is held."""
HOLD_S = 0.05  # mean age of a reading that is refreshed at 10 Hz and held


def interval_text(found: Estimate, name: str, places: int = 3) -> str:
    """'0.335 (0.324 to 0.346)'."""
    i = found.interval(name)
    return f"{i.value:.{places}f} ({i.lower:.{places}f} to {i.upper:.{places}f})"


def page(folder: Path, commit: str) -> str:
    """The whole page."""
    car = Car()
    grips, delays, servos = [], [], []
    for name, floor, axle in DRIVES:
        log = read_car(folder / name)
        body = body_motion(log, car)
        found = grip(body, axle)
        grips.append(
            f"| {name} | {floor} | {axle} | {interval_text(found, 'grip')} | {interval_text(found, 'stiffness', 1)} | {interval_text(found, 'shape', 2)} |"
        )
        gyro, encoder = (sensor_delay(log, body, channel) for channel in ("gyro", "encoder"))
        delays.append(
            f"| {name} | {interval_text(gyro, 'delay', 4)} | {gyro.values['delay'] + HOLD_S:.3f} | {interval_text(gyro, 'scale')} | {interval_text(encoder, 'delay', 4)} |"
        )
        # with the steering held there is no change from which a lag could be seen
        if axle == "rear":
            servo = steering_lag(log, body)
            # the sum is what the recordings determine, hence an interval of its own
            both = servo.derived(servo.values["lag"] + servo.values["delay"], {"lag": 1.0, "delay": 1.0})
            servos.append(
                f"| {name} | {interval_text(servo, 'lag')} | {interval_text(servo, 'delay')} | {both.value:.3f} ({both.lower:.3f} to {both.upper:.3f}) |"
            )
    return "\n".join([
        "# A small car on two floors", "",
        f"`python -m bench.identify_car DATA/dart_rc_car`, commit {commit}: recordings of a 1:10 car under motion capture (DART, TU Delft, IEEE 10588526). Values with 95 % intervals.", "",
        "## Grip", "",
        "| recording | floor | axle | grip | stiffness [1/rad] | shape |", "|---|---|---|---|---|---|", *grips, "",
        "Grip is the peak of the lateral Magic Formula over the axle's weight. Tape has about half the grip of rubber (0.44 by the two drives with the steering held); their intervals do not meet. The recordings give no figure, only the",
        "names of the floors. On rubber no drive passes the peak: the shape (prior 1.4 ± 0.25) goes towards its bound of 1, and its doubt is most of the interval of grip. On tape the front axle slides.", "",
        "## Sensors", "",
        "| recording | gyro: delay of a new reading [s] | with the hold | gyro: scale | encoder: delay of a new reading [s] |", "|---|---|---|---|---|", *delays, "",
        "Both sensors are read at 10 Hz and held, which adds 0.05 s on average. The recordings' description has 0.09 to 0.10 s for the held gyro and a scale of 1.03.",
        "The encoder counts wheels that slip under drive: its scale is that of one drive, and its delay leans on changes of speed.", "",
        "## Steering", "",
        "| recording | lag [s] | delay [s] | both [s] |", "|---|---|---|---|", *servos, "",
        "The description has a lag of about 0.08 s, the authors' own model 0.13 s together with a map of the steering. The recordings determine the sum of lag and delay well, but hardly how it divides between the two. The angle is where",
        "the front axle moves, plus its slip angle as a cubic of the force it carries.", "",
        "## What was assumed", "",
        "Geometry and masses of the description; the yaw inertia as if all mass sat on both axles (samples with more than 20 rad/s² are left out, for which it would matter); no longitudinal",
        "force: grip is what is left beside the drive of all wheels.", "",
    ])  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/results/identification-car.md"))
    options = parser.parse_args()
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    options.out.write_text(page(options.folder, commit), encoding="utf-8")


if __name__ == "__main__":
    main()
