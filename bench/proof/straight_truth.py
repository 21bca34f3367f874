"""Truth of the straight-driving benchmark: another integrator and step, closed loop, noise, CAN resolution.

Independent of discrepancy/models/straight.py on purpose: explicit Runge-Kutta at 5 ms, friction by tanh.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numba
import numpy as np

from discrepancy.signals.recording import Recording, signal

G = 9.81
STEP_S = 0.005
KEEP = 8  # one of 8 steps is recorded: 25 Hz
ORDER = (
    "mass", "viscous", "square", "reverse", "rolling", "slope", "motor_lag",
    "drive_loss", "brake_fade", "slip", "hysteresis", "warming",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """force_sd [N] and its correlation time [s] (0: none); sensor noise; quantised: rounded to CAN bits."""

    force_sd: float = 0.0
    force_s: float = 0.5
    speed_sd: float = 0.01
    acceleration_sd: float = 0.08
    quantised: bool = True


STANDING = ("mass", "viscous")
"""Parameters that act all the time; the others are effects, which may act in an interval only."""
WARM_S = 40.0  # time constant of a warming driveline

WHITE = Noise(quantised=False)
COLOURED = Noise(force_sd=600.0, quantised=False)
QUANTISED = Noise(force_sd=300.0, speed_sd=0.004, acceleration_sd=0.03)


@numba.njit
def _drive(
    always: np.ndarray,
    effects: np.ndarray,
    acts: np.ndarray,
    target: np.ndarray,
    shake: np.ndarray,
    reading: np.ndarray,
    sense: np.ndarray,
) -> np.ndarray:
    """Closed loop; rows: speed of the machine, wheel speed, acceleration, drive command, brake command.

    always: parameters without the effects; effects: what they add where `acts` is 1; reading: error of the speed the driver acts on;
    sense: (scale, delay in steps) of the speed sensor.
    """
    n = target.size
    out = np.zeros((5, n))
    v, force, memory, command, brake = 0.0, 0.0, 0.0, 0.0, 0.0
    delay = round(sense[1])
    for i in range(n):
        mass, cold, square, reverse, rolling, slope, lag, loss, fade, slip, hysteresis, warming = (
            always + acts[i] * effects
        )
        viscous = cold * (1.0 - warming * (1.0 - np.exp(-i * STEP_S / WARM_S)))
        out[0, i] = v
        traction = force * (1.0 - loss)
        out[1, i] = v * (1.0 + slip * traction / (mass * G))
        if i % 8 == 0:  # the driver and the controller act at 25 Hz
            seen = out[1, max(i - delay, 0)] * (1.0 + sense[0]) + reading[i]
            error = target[i] - seen
            command = min(max(9000.0 * error + 400.0 * target[i], -35e3), 35e3)
            brake = 0.0
            # a driver who wants to stand brakes instead of reversing the motor
            if abs(target[i]) < 0.05 and abs(seen) > 0.1:
                brake, command = 12e3, 0.0
        out[3, i], out[4, i] = command, brake
        if lag < 1e-6:
            force = command
        # play of 6 kN: hysteresis remembers the way by which a force was reached
        memory = min(max(memory, force - 6000.0), force + 6000.0)
        steady = -hysteresis * np.tanh((force - memory) / 2000.0) - mass * G * np.sin(slope) + shake[i]
        k = np.zeros(4)
        for stage in range(4):
            # classical Runge-Kutta of order 4; the command is constant over a step, the motor's lag exact
            after = 0.0 if stage == 0 else (STEP_S if stage == 3 else 0.5 * STEP_S)
            at = v + after * (k[stage - 1] if stage else 0.0)
            late = command + (force - command) * np.exp(-after / lag) if lag >= 1e-6 else command
            push = late * (1.0 - loss) + steady
            resist = viscous * at + square * at * abs(at) + (reverse * at if at < 0.0 else 0.0)
            resist += (mass * G * rolling + brake * (1.0 - fade)) * at / np.sqrt(at * at + 0.05**2)
            k[stage] = (push - resist) / mass
        if lag >= 1e-6:
            force = command + (force - command) * np.exp(-STEP_S / lag)
        out[2, i] = (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]) / 6.0
        v += STEP_S * out[2, i]
    return out


def record(
    truth: Mapping[str, float],
    noise: Noise,
    rng: np.random.Generator,
    *,
    duration_s: float = 96.0,
    one_way: bool = False,
    interval: tuple[float, float] | None = None,
    keep: int = KEEP,
) -> Recording:
    """Drive a random sequence of target speeds; truth: parameters by the model's names, mass and sensors included.

    keep: one of so many steps is recorded. interval: the time [s] in which the effects act; else always.
    """
    n = int(duration_s / STEP_S)
    always = np.array([truth.get(name, 0.0) if name in STANDING else 0.0 for name in ORDER])
    effects = np.array([0.0 if name in STANDING else truth.get(name, 0.0) for name in ORDER])
    acts = np.ones(n)
    if interval is not None:
        at = STEP_S * np.arange(n)
        acts = ((at >= interval[0]) & (at < interval[1])).astype(float)
    target = np.repeat(
        rng.choice([0.0, 1.5, 3.0, 5.0] if one_way else [-3.0, -1.5, 0.0, 2.0, 5.0], size=n // 600 + 1), 600
    )[:n]
    # a second to change from one speed to another, as a driver does
    target = np.convolve(target, np.ones(200) / 200.0, mode="same")
    shake = np.zeros(n)
    if noise.force_sd:
        a = np.exp(-STEP_S / noise.force_s)
        drive = rng.normal(0.0, noise.force_sd * np.sqrt(1.0 - a * a), n)
        for i in range(1, n):
            shake[i] = a * shake[i - 1] + drive[i]
    reading = rng.normal(0.0, noise.speed_sd, n)
    sense = np.array([truth.get("speed.scale", 0.0), truth.get("speed.delay", 0.0) / STEP_S])
    out = _drive(always, effects, acts, target, shake, reading, sense)
    time_s = STEP_S * np.arange(n)
    rows = slice(0, n, keep)
    wheel = np.interp(time_s - truth.get("speed.delay", 0.0), time_s, out[1]) * (1.0 + sense[0]) + reading
    # the accelerometer averages over 10 ms from its stamp on
    acceleration = 0.5 * (out[2] + np.append(out[2, 1:], out[2, -1]))
    force = acceleration + G * np.sin(acts * truth.get("slope", 0.0))
    force = force * (1.0 + truth.get("acceleration.scale", 0.0)) + truth.get("acceleration.bias", 0.0)
    force = force + rng.normal(0.0, noise.acceleration_sd, n)
    if noise.quantised:
        # 1/256 km/h and 0.01 m/s²: resolutions usual in J1939 messages
        wheel, force = np.round(wheel * 256.0 * 3.6) / 256.0 / 3.6, np.round(force / 0.01) * 0.01
    return Recording(
        "straight",
        {
            "drive_force": signal(time_s[rows], out[3, rows], "N", held=True),
            "brake_force": signal(time_s[rows], out[4, rows], "N", held=True),
            "speed": signal(time_s[rows], wheel[rows], "m/s"),
            "acceleration": signal(time_s[rows], force[rows], "m/s^2"),
        },
    )
