"""A small car: truth in steps of 1 ms, sensors at their own rates and resolutions, commands by chance.

Who steers moves smoothly, and commands are samples of that. Were they held for 10 ms in truth, a bicycle without inertia would turn in
jumps, at the very stamps of its sensors: they would read any delay up to 10 ms alike, and half of that besides what was hidden.
"""

import numba
import numpy as np
from scipy.signal import lfilter, lsim

from bench.proof.arm import Arm
from bench.proof.body import Body
from bench.proof.stamps import rows
from discrepancy.models.car import WHEELBASE_M, model
from discrepancy.signals.recording import Recording, signal

G = 9.81
STEP_S = 1e-3
DURATION_S = 60.0
GYRO_EVERY, ENCODER_EVERY, REFERENCE_EVERY, COMMAND_EVERY = 20, 50, 20, 10  # steps; all at whole commands
HAND_S = 0.15  # time constant of who steers; faster, and 50 Hz of motion capture would not hold the turns
GYRO_SD, ENCODER_SD, REFERENCE_SD = 0.02, 0.02, 0.003  # the model takes the reference for the state
GYRO_BIT, ENCODER_BIT = 0.01, 0.02


@numba.njit
def _yaw(
    angle: np.ndarray,
    speed: np.ndarray,
    understeer: float,
    slipperiness: float,
    relaxation: float,
    play: float,
) -> np.ndarray:
    """Yaw rate [rad/s] of a bicycle; play: half the dead zone of the steering [rad], which no effect of the library is."""
    out = np.empty(angle.size)
    now, before, held = 0.0, 0.0, angle[0]
    for i in range(angle.size):
        # play: the wheels follow only at the edges of the dead zone
        held = min(max(held, angle[i] - play), angle[i] + play)
        v = speed[i]
        steady = v * np.tan(held) / (WHEELBASE_M * (1.0 + understeer * v * v))
        demanded = slipperiness * v * steady / G
        steady = steady / np.sqrt(1.0 + demanded * demanded)
        if relaxation > 0.0 and i > 0:
            # relaxation goes by way, not by time; the last term keeps a standing car from 0/0
            rolled = abs(v) * STEP_S / relaxation + 1e-9
            kept = np.exp(-rolled)
            mean = (1.0 - kept) / rolled  # of what is kept over the step, in which the demand goes straight
            now = kept * now + (mean - kept) * before + (1.0 - mean) * steady
        else:
            now = steady
        before = steady
        out[i] = now
    return out


def recorded(values, arm: Arm, rng: np.random.Generator) -> list[Recording]:
    """A minute of steering steps at changing speed; the steering's own map differs from the model's start."""
    n = round(DURATION_S / STEP_S)
    time_s = STEP_S * np.arange(n)
    turns = np.repeat(rng.uniform(-0.8, 0.8, n // 700 + 1), 700)[:n]
    # twice: a hand has neither jumps nor kinks
    steering = _lagged(_lagged(turns, HAND_S), HAND_S)
    throttle = np.repeat(rng.uniform(0.15, 0.4, n // 4000 + 1), 4000)[:n]
    speed = _lagged(4.0 * throttle, 0.6)
    gain, cubic, offset = 0.4 + 0.03 * rng.normal(), 0.03 * rng.normal(), 0.01 * rng.normal()
    angle = gain * steering + cubic * steering**3 + offset
    if "servo_rate" in values:
        angle = _limited(angle, values["servo_rate"])
    angle = _late(_lagged(angle, values.get("servo_lag", 0.0)), values.get("servo_delay", 0.0))
    yaw = _yaw(
        angle,
        speed,
        values.get("understeer", 0.0),
        values.get("slipperiness", 0.0),
        values.get("relaxation", 0.0),
        values.get("play", 0.0),
    )
    yaw, encoded = _wild(values, rng, time_s, yaw, speed, throttle)
    (own,) = rng.spawn(1)  # other stamps have the same drive and noise
    gyro_rows, encoder_rows, reference, command = (
        rows(n, every, arm.stamps, own)
        for every in (GYRO_EVERY, ENCODER_EVERY, REFERENCE_EVERY, COMMAND_EVERY)
    )
    # a held command is logged when it changes, too: else it would come up to a period late
    held = np.union1d(command, 1 + np.flatnonzero(np.diff(throttle))) if arm.stamps else command
    gyro = _sensed(
        yaw + values.get("g_sensitivity", 0.0) * yaw * speed,
        "gyro",
        values,
        gyro_rows,
        _noise(rng, n, GYRO_SD, arm),
        GYRO_BIT if arm.noise == "quantised" else 0.0,
    )
    encoder = _sensed(
        encoded,
        "encoder",
        values,
        encoder_rows,
        _noise(rng, n, ENCODER_SD, arm),
        ENCODER_BIT if arm.noise == "quantised" else 0.0,
    )
    if "outliers" in values:
        wrong = rng.random(encoder.size) < values["outliers"]
        encoder = np.where(wrong, encoder + rng.normal(0.0, 1.0, encoder.size), encoder)
    gyro_s = time_s[gyro_rows] * (1.0 + values.get("drift", 0.0))
    signals = {
        "steering": signal(time_s[command], steering[command], "1"),
        "throttle": signal(time_s[held], throttle[held], "1", held=True),
        "speed_reference": signal(time_s[command], speed[command], "m/s"),
        "gyro": signal(gyro_s, gyro, "rad/s"),
        "encoder": signal(time_s[encoder_rows], encoder, "m/s"),
        "yaw_rate_reference": signal(
            time_s[reference], (yaw + REFERENCE_SD * rng.normal(size=n))[reference], "rad/s"
        ),
    }
    return [Recording("car", signals)]


def _wild(
    values,
    rng: np.random.Generator,
    time_s: np.ndarray,
    yaw: np.ndarray,
    speed: np.ndarray,
    throttle: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Yaw rate and speed at the driven wheels, where the truth differs from the model in structure.

    yaw_damping: the body swings into a turn [share]; camber: the road pulls by heading [rad/s]; slide: a second in which the wheels lock [s];
    drive_slip: the driven wheels slip by the throttle.
    """
    if "yaw_damping" in values:
        natural, damping = 2.0 * np.pi * 4.0, values["yaw_damping"]
        yaw = lsim((natural**2, (1.0, 2.0 * damping * natural, natural**2)), yaw, time_s)[1]
    if "camber" in values:
        yaw = yaw + values["camber"] * np.sin(np.cumsum(yaw) * STEP_S)
    encoded = speed * (1.0 + values.get("drive_slip", 0.0) * (throttle - 0.25))
    if "slide" in values:
        start = int(rng.uniform(10.0, 45.0) / STEP_S)
        encoded[start : start + round(values["slide"] / STEP_S)] = 0.0
    return yaw, encoded


@numba.njit
def _limited(angle: np.ndarray, rate: float) -> np.ndarray:
    """The angle of a servo that turns no faster than `rate` [rad/s]."""
    out = np.empty(angle.size)
    out[0] = angle[0]
    for i in range(1, angle.size):
        out[i] = out[i - 1] + min(max(angle[i] - out[i - 1], -rate * STEP_S), rate * STEP_S)
    return out


def _noise(rng: np.random.Generator, n: int, sd: float, arm: Arm) -> np.ndarray:
    white = sd * rng.normal(size=n)
    if arm.noise != "coloured":
        return white
    # correlated over 0.05 s, two or three gyro samples, with the variance of the white noise
    a = float(np.exp(-STEP_S / 0.05))
    return lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], white)


def _sensed(
    true: np.ndarray, name: str, values, read: np.ndarray, noise: np.ndarray, bit: float
) -> np.ndarray:
    seen = _late(_lagged(true, values.get(f"{name}.lag", 0.0)), values.get(f"{name}.delay", 0.0))
    seen = seen * (1.0 + values.get(f"{name}.scale", 0.0)) * (1.0 - 2.0 * values.get(f"{name}.sign", 0.0))
    seen = (seen + values.get(f"{name}.bias", 0.0) + noise)[read]
    # last: a converter rounds what bias, scale and noise have made
    return np.round(seen / bit) * bit if bit else seen


def _lagged(values: np.ndarray, time_constant_s: float) -> np.ndarray:
    """First-order lag by the trapezoidal rule, settled at the start."""
    if time_constant_s <= 0.0:
        return values
    a = STEP_S / (2.0 * time_constant_s + STEP_S)
    return lfilter([a, a], [1.0, 2.0 * a - 1.0], values, zi=[(1.0 - a) * values[0]])[0]


def _late(values: np.ndarray, delay_s: float) -> np.ndarray:
    at = STEP_S * np.arange(values.size)
    return np.interp(at - delay_s, at, values) if delay_s else values


CAR = Body(
    name="car",
    model=model,
    record=recorded,
    noises=("white", "coloured", "quantised"),
    nulls=100,
    outside={"steering play 0.01 rad": {"play": 0.01}, "steering play 0.03 rad": {"play": 0.03}},
    moving=("steering",),
    pairs=(("servo lag", "encoder delay"), ("understeer", "gyro scale"), ("gyro delay", "encoder scale")),
)
