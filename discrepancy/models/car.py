"""A small car with delays: kinematic bicycle, steering servo, gyro and wheel encoder, each of which may be late.

Axes ISO 8855; steering + = left. Yaw rate r = v tan(delta) / L. Where a reference (motion capture) was recorded it is
taken as the state, so that the on-board sensors are judged against it; without it the bicycle is the
state and a servo's lag and a gyro's delay share one path. The reference yaw rate itself is always predicted by the bicycle.
Sources: Lyons et al., DART, IEEE 10588526 (car, geometry); Rajamani, Vehicle Dynamics and Control, 2.2 (bicycle).
"""

import csv
import gzip
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from discrepancy.model.description import Effect, Manoeuvre, Model, Parameter, Port, Window
from discrepancy.model.sensors import delayed, lagged, sensor_effects
from discrepancy.signals.recording import Array, Recording, changes_only, signal

WHEELBASE_M = 0.1735
STEP_S = 0.01
G = 9.81
REFERENCE_EVERY = 5  # rows of 100 Hz between samples of the reference
SMOOTH = 15  # rows of the centred local cubic that differentiates the reference; centred, so without phase


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """Yaw rates [rad/s] and speeds [m/s] on the grid."""
    command, time_s, step = window["steering"], window.time_s, window.step_s
    angle = values["steer_gain"] * command + values["steer_cubic"] * command**3 + values["steer_offset"]
    angle = delayed(lagged(angle, values.get("servo_lag", 0.0), step), values.get("servo_delay", 0.0), time_s)
    speed = (
        window["speed_reference"]
        if window.has("speed_reference")
        else _speed(window["throttle"], values, step)
    )
    yaw_rate = speed * np.tan(angle) / (WHEELBASE_M * (1.0 + values.get("understeer", 0.0) * speed**2))
    demanded = values.get("slipperiness", 0.0) * speed * yaw_rate / G  # lateral acceleration over mu g
    yaw_rate = yaw_rate / np.sqrt(1.0 + demanded**2)
    yaw_rate = _relaxed(yaw_rate, speed, values.get("relaxation", 0.0), step) + extra.get("yaw rate", 0.0)
    turned = window["yaw_rate_reference"] if window.has("yaw_rate_reference") else yaw_rate
    return {"gyro": turned, "encoder": speed, "yaw_rate_reference": yaw_rate}


def _relaxed(yaw_rate: Array, speed: Array, length_m: float, step: float) -> Array:
    """First-order lag of the yaw rate over rolled distance (relaxation length)."""
    # Only the change is interpolated between time and distance: an interpolation error of the whole signal would look like an effect.
    if length_m < 1e-9:
        return yaw_rate
    rolled = np.cumsum(np.abs(speed) * step + 1e-9)
    even = np.linspace(rolled[0], rolled[-1], 2 * rolled.size)
    prompt = np.interp(even, rolled, yaw_rate)
    late = lagged(prompt, length_m, float(even[1] - even[0]))
    return yaw_rate + np.interp(rolled, even, late - prompt)


def _speed(throttle: Array, values: Mapping[str, float], step: float) -> Array:
    """First-order response of speed to throttle beyond its dead band."""
    push = np.maximum(throttle - values["dead_band"], 0.0)
    return lagged(values["speed_gain"] * push, values["speed_lag"], step)


def _lag(
    name: str, sentence: str, equation: str, parameter: str, place: str, confusable: Mapping[str, str]
) -> Effect:
    return Effect(
        name=name,
        sentence=sentence,
        equation=equation,
        parameters=(
            Parameter(name=parameter, unit="s", lower=0.0, upper=0.5, typical=0.05, trial_steps=(0.05, 0.15)),
        ),
        kind="physics",
        place=place,
        excited_by="fast steering",
        confusable=confusable,
    )


PATH = "record the yaw rate by motion capture, or turn the car by hand: only the sensor is then in the path"
PHYSICS = (
    _lag(
        "servo lag",
        "the steering servo follows its command with a first-order lag",
        "tau d(delta)/dt + delta = delta_command",
        "servo_lag",
        "steering servo",
        {"servo delay": "a steering step: a lag rounds it", "gyro delay": PATH, "gyro lag": PATH},
    ),
    _lag(
        "servo delay",
        "the steering servo starts late",
        "delta(t) = delta_command(t - T)",
        "servo_delay",
        "steering servo",
        {"servo lag": "a steering step: a delay shifts it", "gyro delay": PATH, "gyro lag": PATH},
    ),
    Effect(
        name="tyre relaxation",
        sentence="the side force, and with it the yaw rate, builds up over a rolled distance",
        equation="(sigma / v) dr/dt + r = v tan(delta) / L",
        parameters=(Parameter(name="relaxation", unit="m", lower=0.0, upper=0.04, typical=0.02),),
        kind="physics",
        place="tyres",
        excited_by="fast steering at several speeds",
        confusable={"servo lag": "the same steering steps at a third of the speed"},
    ),
    Effect(
        name="understeer",
        sentence="slip angles make the car turn less with speed squared",
        equation="r = v tan(delta) / (L (1 + K v²))",
        parameters=(Parameter(name="understeer", unit="s^2/m^2", lower=-0.1, upper=2.0, typical=0.03),),
        kind="physics",
        place="yaw motion of the body",
        excited_by="the same steering at several speeds",
        confusable={"grip limit": "small steering at high speed"},
    ),
    Effect(
        name="grip limit",
        sentence="the lateral acceleration saturates at the floor's grip",
        equation="r = r0 / sqrt(1 + (c v r0 / g)²), c = 1/mu",
        parameters=(
            Parameter(
                name="slipperiness", unit="1", lower=0.0, upper=6.0, typical=1.0, trial_steps=(1.0, 2.0)
            ),
        ),
        kind="physics",
        place="tyres",
        excited_by="turns near the limit",
        confusable={"understeer": "small steering at high speed"},
    ),
)
SENSORS = (
    *sensor_effects("gyro", "rad/s", bias=0.02, kinds=("bias", "scale", "delay", "lag", "sign")),
    *sensor_effects("encoder", "m/s", bias=0.05, kinds=("bias", "scale", "delay", "lag")),
)
NUISANCES = (
    Parameter(name="steer_gain", unit="rad", value=0.4, lower=0.05, upper=1.0, typical=0.05),
    Parameter(name="steer_cubic", unit="rad", value=0.0, lower=-0.5, upper=0.5, typical=0.05),
    Parameter(name="steer_offset", unit="rad", value=0.0, lower=-0.2, upper=0.2, typical=0.01),
)
DRIVE = (
    Parameter(name="speed_gain", unit="m/s", value=8.0, lower=0.1, upper=50.0, typical=1.0),
    Parameter(name="dead_band", unit="1", value=0.1, lower=0.0, upper=0.5, typical=0.02),
    Parameter(name="speed_lag", unit="s", value=0.5, lower=0.02, upper=5.0, typical=0.1),
)


def model(*, reference: bool = True, without: tuple[str, ...] = ()) -> Model:
    """The car. reference: motion capture is in the recording; else speed comes from throttle alone."""
    inputs = {"steering": "1", "throttle": "1"} | ({"speed_reference": "m/s"} if reference else {})
    return Model(
        name="car",
        sentence="a small car with a steering servo, a gyro and a wheel encoder",
        inputs=inputs,
        held=("steering", "throttle"),
        outputs={"gyro": "rad/s", "encoder": "m/s", "yaw_rate_reference": "rad/s"},
        nuisances=NUISANCES if reference else (*NUISANCES, *DRIVE),
        effects=tuple(e for e in (*PHYSICS, *SENSORS) if e.name not in without),
        simulate=simulate,
        step_s=STEP_S,
        window_s=16.0,
        lead_s=1.0,
        ports=(Port(name="yaw rate", unit="rad/s", typical=0.1, sentence="yaw rate beyond the bicycle's"),),
        manoeuvres=(_slalom(reference), _surge(reference)),
    )


def _slalom(reference: bool) -> Manoeuvre:
    time_s = np.arange(0.0, 12.0, STEP_S)
    steps = 0.5 * np.sign(np.sin(2.0 * np.pi * time_s / 1.6))
    inputs = {
        "steering": signal(time_s, steps, "1", held=True),
        "throttle": signal(time_s, np.full(time_s.size, 0.3), "1", held=True),
    }
    if reference:
        inputs["speed_reference"] = signal(time_s, np.full(time_s.size, 1.5), "m/s")
    return Manoeuvre(
        name="steering steps",
        sentence="full steering steps left and right at constant speed, 0.8 s each",
        duration_s=12.0,
        inputs=inputs,
    )


def _surge(reference: bool) -> Manoeuvre:
    time_s = np.arange(0.0, 32.0, STEP_S)
    throttle = np.where(np.sin(2.0 * np.pi * time_s / 5.0) > 0.0, 0.4, 0.2)
    throttle = np.where(time_s % 16.0 < 8.0, throttle, 0.3)  # and every other 8 s at one speed
    inputs = {
        "steering": signal(time_s, 0.4 * np.sign(np.sin(2.0 * np.pi * time_s / 2.2)), "1", held=True),
        "throttle": signal(time_s, throttle, "1", held=True),
    }
    if reference:
        usual = {p.name: p.value for p in DRIVE}
        inputs["speed_reference"] = signal(time_s, _speed(throttle, usual, STEP_S), "m/s")
    return Manoeuvre(
        name="changing throttle",
        sentence="steps of the throttle between a fifth and two fifths while steering left and right, 1.1 s each",
        duration_s=32.0,
        inputs=inputs,
    )


DART = (
    "vicon time",
    "vicon x",
    "vicon y",
    "vicon yaw",
    "W (IMU)",
    "vel encoder",
    "throttle",
    "steering",
)


def is_dart(path: Path) -> bool:
    """Whether a CSV file, maybe compressed, has DART's columns."""
    opener = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rt", newline="") as file:
            return set(DART) <= set(next(csv.reader(file), []))
    except (OSError, EOFError, UnicodeDecodeError, csv.Error):
        return False


def load_dart(path: Path, *, reference: bool = True) -> Recording:
    """One file of DART; slow sensors repeat their values in its 100 Hz rows and are reduced to their own samples."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise ValueError(f"{path.name}: has a heading but no rows")
    column = {name: np.array([float(row[name]) for row in rows]) for name in DART}
    time_s = column["vicon time"] - column["vicon time"][0]
    moving = slice(*_moving(column["vel encoder"]))
    time_s = time_s[moving]
    signals = {
        "steering": signal(time_s, column["steering"][moving], "1", held=True),
        "throttle": signal(time_s, column["throttle"][moving], "1", held=True),
        "gyro": changes_only(time_s, column["W (IMU)"][moving], "rad/s"),
        "encoder": changes_only(time_s, column["vel encoder"][moving], "m/s"),
    }
    if reference:
        yaw = np.unwrap(column["vicon yaw"])
        step = float(np.median(np.diff(column["vicon time"])))
        rate, vx, vy = (
            savgol_filter(v, SMOOTH, 3, deriv=1, delta=step)
            for v in (yaw, column["vicon x"], column["vicon y"])
        )
        forward = vx * np.cos(yaw) + vy * np.sin(yaw)
        signals["yaw_rate_reference"] = signal(
            time_s[::REFERENCE_EVERY], rate[moving][::REFERENCE_EVERY], "rad/s"
        )
        signals["speed_reference"] = signal(time_s, forward[moving], "m/s")
    return Recording(path.name, signals)


def _moving(encoder: Array) -> tuple[int, int]:
    """First and last row at which the car drives."""
    rows = np.flatnonzero(encoder > 0.0)
    return (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, encoder.size)
