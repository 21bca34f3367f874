"""A road vehicle along its path: compares accelerometers and pitch gyro with the acceleration of the wheels.

Axes ISO 8855 but for the pitch rate, which counts nose UP (so that it is the rate of the grade). An accelerometer measures
specific force: f = dv/dt + g sin(grade) plus the body's own pitch. The grade is a function of the distance driven, linear
between knots, so it acts on every sensor at the same place of the road; a drifting sensor does not.
Sources: Bae, Ryu, Gerdes (IEEE ITSC 2001) for grade from accelerometer and wheels; Gillespie, Fundamentals of Vehicle
Dynamics (SAE 1992), chapters 1 and 7 for drag and squat.
"""

import gzip
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cantools
import numpy as np
from cantools.database.can import Message
from scipy.ndimage import gaussian_filter1d
from scipy.signal import savgol_filter

from discrepancy.model.description import Effect, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Array, Recording, Signal, signal

G = 9.81
STEP_S = 0.02
KNOT_M = 50.0  # between knots of the grade; roads hardly change their grade within less
SMOOTH = 15  # grid points of the centred quadratic that differentiates the pitch: 0.3 s, no phase
AVERAGED_S = 0.05  # vibration of the body is averaged out over this time
KMH = 1.0 / 3.6


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """Specific forces [m/s²] and nose-up pitch rate [rad/s] on the grid."""
    speed, step = window["wheel_speed"], window.step_s
    felt = values["wheel_smoothing"] / step
    acceleration = gaussian_filter1d(speed, felt, order=1, mode="nearest") / step
    knots = [values[name] for name in sorted(n for n in values if n.startswith("grade."))]
    grade = np.zeros(speed.size)
    if knots:
        grade = np.interp(_driven(window), KNOT_M * np.arange(len(knots)), knots)
    squat = values.get("squat", 0.0) * acceleration
    pitch = grade + squat
    pitch_rate = savgol_filter(
        pitch, min(SMOOTH, pitch.size // 2 * 2 - 1), 2, deriv=1, delta=step, mode="nearest"
    )
    force = acceleration * (1.0 + values.get("wheel_radius", 0.0)) + G * np.sin(pitch)
    force = force + extra.get("specific force", 0.0)
    drag = values.get("drag", 0.0) * speed**2
    return {
        "accel_x": force + drag,
        "imu_x": force + drag + G * values["mounting"],
        "pitch_rate": pitch_rate,
    }


def _driven(window: Window) -> Array:
    """Distance [m] along the path, from the wheels where it was not recorded (the window is then the whole recording)."""
    if window.has("distance"):
        return window["distance"]
    return np.asarray(np.cumsum(window["wheel_speed"]) * window.step_s, float)


NUISANCES = (
    Parameter(name="mounting", unit="rad", lower=-0.2, upper=0.2, typical=0.01, prior_sd=0.03),
    # Wheels swing on their tyres, and their sensors count teeth; such fast changes do not reach the body. A centred filter adds no phase.
    Parameter(name="wheel_smoothing", unit="s", value=0.1, lower=0.04, upper=1.0, typical=0.1),
)


def grade_profile(length_m: float) -> Effect:
    """Road grade as a function of distance."""
    count = int(np.ceil(length_m / KNOT_M)) + 1
    return Effect(
        name="road grade",
        sentence="the road climbs and falls: gravity is in the accelerometer but not in the wheels",
        equation="f = dv/dt + g sin(theta(s)), pitch rate = v dtheta/ds",
        parameters=tuple(
            Parameter(name=f"grade.{i:03d}", unit="rad", lower=-0.3, upper=0.3, typical=0.02, prior_sd=0.05)
            for i in range(count)
        ),
        kind="physics",
        place="gravity along the path",
        excited_by="a hilly road",
        confusable={
            "accel_x drift": "drive the same road back",
            "imu_x drift": "drive the same road back",
            "speed-squared force": "drive the same road back",
        },
    )


PHYSICS = (
    Effect(
        name="squat",
        sentence="the body pitches nose up under acceleration, and the sensors with it",
        equation="theta_body = k dv/dt",
        parameters=(Parameter(name="squat", unit="rad.s^2/m", lower=-0.01, upper=0.05, typical=0.005),),
        kind="physics",
        place="suspension",
        excited_by="braking and accelerating",
        confusable={"imu_x scale": "a steady climb: scale acts there, squat does not"},
    ),
    Effect(
        name="wheel slip or radius",
        sentence="the wheels turn out more acceleration than the vehicle has, or less",
        equation="a = (1 + c) dv/dt",
        parameters=(Parameter(name="wheel_radius", unit="1", lower=-0.2, upper=0.2, typical=0.03),),
        kind="physics",
        place="wheels",
        excited_by="braking and accelerating",
        confusable={"squat": "constant speed on a climb"},
    ),
    Effect(
        name="speed-squared force",
        sentence="an error in proportion to speed squared (cornering drag, rectified vibration)",
        equation="f += c v²",
        parameters=(Parameter(name="drag", unit="1/m", lower=-0.01, upper=0.01, typical=0.0005),),
        kind="physics",
        place="along the path",
        excited_by="a wide range of speeds",
    ),
)


def library(length_m: float) -> tuple[Effect, ...]:
    return (
        grade_profile(length_m),
        *PHYSICS,
        *sensor_effects("accel_x", "m/s^2", bias=0.2, delay_s=0.05),
        *sensor_effects("imu_x", "m/s^2", bias=0.2, kinds=("scale", "delay", "lag", "sign", "drift")),
        *sensor_effects("pitch_rate", "rad/s", bias=0.005, kinds=("bias", "scale", "sign")),
    )


def model(recordings: Sequence[Recording], *, without: tuple[str, ...] = ()) -> Model:
    """The vehicle; the length of the grade's profile is that of the longest recording."""
    length = max((_length(r) for r in recordings), default=0.0)
    return Model(
        name="road",
        sentence="a road vehicle along its path: wheel speed, accelerometers, pitch gyro",
        inputs={"wheel_speed": "m/s"},
        optional={"distance": "m"},
        outputs={"accel_x": "m/s^2", "imu_x": "m/s^2", "pitch_rate": "rad/s"},
        nuisances=NUISANCES,
        effects=tuple(e for e in library(length) if e.name not in without),
        simulate=simulate,
        step_s=STEP_S,
        window_s=None,
        lead_s=1.0,
        held_out_s=1.0,
        ports=(
            Port(name="specific force", unit="m/s^2", typical=0.2, sentence="force per mass along the path"),
        ),
    )


def _length(recording: Recording) -> float:
    for name in ("distance", "wheel_speed"):
        if name in recording.signals and recording.signals[name].time_s.size > 1:
            signal = recording.signals[name]
            driven = signal if name == "distance" else _distance(signal)
            return float(np.max(driven.value, initial=0.0))
    return 0.0


def load_comma(folder: Path, *, imu: bool = True) -> Recording:
    """The minute of comma2k19 with its raw CAN; position and pose stay concealed. imu: with the phone's sensors."""
    wheel, accel = _decoded(folder)
    signals = {"wheel_speed": wheel, "distance": _distance(wheel), "accel_x": averaged(accel)}
    if imu:
        with np.load(folder / "segment40.npz") as arrays:
            t, f = arrays["IMU_accelerometer_t"], arrays["IMU_accelerometer_value"]
            tw, w = arrays["IMU_gyro_t"], arrays["IMU_gyro_value"]
        # forward, right, down: turning about the right axis lifts the nose
        signals["imu_x"] = averaged(signal(t, f[:, 0], "m/s^2"))
        signals["pitch_rate"] = averaged(signal(tw, w[:, 1], "rad/s"))
    return Recording("comma2k19 RAV4, segment 40", signals)


def _distance(speed: Signal) -> Signal:
    steps = 0.5 * (speed.value[1:] + speed.value[:-1]) * np.diff(speed.time_s)
    return signal(speed.time_s, np.concatenate(([0.0], np.cumsum(steps))), "m")


def averaged(source: Signal, over_s: float = AVERAGED_S) -> Signal:
    """Block means with their mean stamps, so nothing is delayed."""
    block = ((source.time_s - source.time_s[0]) / over_s).astype(int)
    count = np.maximum(np.bincount(block), 1)
    full = np.bincount(block) > 0
    t, y = np.bincount(block, source.time_s) / count, np.bincount(block, source.value) / count
    return signal(t[full], y[full], source.unit)


def _decoded(folder: Path) -> tuple[Signal, Signal]:
    """Mean wheel speed [m/s] and KINEMATICS.ACCEL_X [m/s²], as the DBC says, of bus can0."""
    database = cantools.database.load_file(folder / "_toyota_2017.dbc", strict=False)
    wheels, kinematics = (_message(database, name) for name in ("WHEEL_SPEEDS", "KINEMATICS"))
    rows: dict[int, list[tuple[float, float]]] = {wheels.frame_id: [], kinematics.frame_id: []}
    with gzip.open(folder / "segment40_can.candump.log.gz", "rt") as log:
        for line in log:
            stamp, channel, frame = line.split()
            identifier, _, data = frame.partition("#")
            number = int(identifier, 16)
            if channel != "can0" or number not in rows:
                continue
            message = wheels if number == wheels.frame_id else kinematics
            decoded: Any = message.decode(bytes.fromhex(data), decode_choices=False)
            if message is wheels:
                value = KMH * sum(float(decoded[f"WHEEL_SPEED_{w}"]) for w in ("FL", "FR", "RL", "RR")) / 4.0
            else:
                value = float(decoded["ACCEL_X"])
            rows[number].append((float(stamp.strip("()")), value))
    (tw, v), (ta, a) = (np.array(rows[m.frame_id]).T for m in (wheels, kinematics))
    return signal(tw, v, "m/s"), signal(ta, a, "m/s^2")


def _message(database: Any, name: str) -> Message:
    message: Message = database.get_message_by_name(name)
    return message
