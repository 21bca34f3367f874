"""Truth of the straight-driving benchmark: another integrator and step, closed loop, noise, CAN resolution.

Independent of discrepancy/models/straight.py on purpose: explicit Runge-Kutta at 5 ms, friction by tanh.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from scipy.signal import lfilter

from bench.proof.stamps import rows as stamped
from discrepancy.signals.recording import Recording, signal

G = 9.81
STEP_S = 0.005
KEEP = 8  # one of 8 steps is recorded: 25 Hz
CONTROLLED = 8  # and the driver and the controller act at 25 Hz
BETWEEN = 7  # and a little more often where their commands are to come between the readings
ORDER = (
    "mass", "viscous", "square", "reverse", "rolling", "slope", "motor_lag",
    "drive_loss", "brake_fade", "slip", "hysteresis", "warming",
)  # fmt: skip
STRUCTURE = ("power", "brake_lag", "backlash", "loss_by_speed", "ripple", "stribeck")
"""Laws in which the wild arms differ from the model, all the time: the viscous resistance goes with |v|^(1 + power), the brake comes late
[s], after a reversal the motor first crosses a play [s], the loss of the drive grows with speed [s/m], the traction ripples with the
angle of the wheels (share), and dry friction falls with speed [share of the weight]."""
WHEEL_M = 0.7


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
    structure: np.ndarray,
    controlled: np.ndarray,
) -> np.ndarray:
    """Closed loop; rows: speed of the machine, wheel speed, acceleration, drive command, brake command.

    always: parameters without the effects; effects: what they add where `acts` is 1; reading: error of the speed the driver acts on;
    sense: (scale, delay in steps) of the speed sensor; structure: values of STRUCTURE; controlled (n,): steps at which driver and controller act.
    """
    n = target.size
    out = np.zeros((5, n))
    v, force, memory, command, brake = 0.0, 0.0, 0.0, 0.0, 0.0
    power, brake_lag, backlash, loss_by_speed, ripple, stribeck = structure
    braking, angle, side, crossing = 0.0, 0.0, 1.0, 0.0
    delay = round(sense[1])
    for i in range(n):
        mass, cold, square, reverse, rolling, slope, lag, loss, fade, slip, hysteresis, warming = (
            always + acts[i] * effects
        )
        viscous = cold * (1.0 - warming * (1.0 - np.exp(-i * STEP_S / WARM_S)))
        out[0, i] = v
        angle += STEP_S * v / WHEEL_M
        # of the force, what reaches the wheels: nothing while a play is crossed
        passed = (1.0 - loss_by_speed * abs(v)) * (1.0 + ripple * np.sin(6.0 * angle))
        if force * side < 0.0:
            side, crossing = -side, backlash
        if crossing > 0.0:
            crossing -= STEP_S
            passed = 0.0
        traction = force * (1.0 - loss) * passed
        out[1, i] = v * (1.0 + slip * traction / (mass * G))
        if controlled[i]:
            seen = out[1, max(i - delay, 0)] * (1.0 + sense[0]) + reading[i]
            error = target[i] - seen
            command = min(max(9000.0 * error + 400.0 * target[i], -35e3), 35e3)
            brake = 0.0
            # a driver who wants to stand brakes instead of reversing the motor
            if abs(target[i]) < 0.05 and abs(seen) > 0.1:
                brake, command = 12e3, 0.0
        out[3, i], out[4, i] = command, brake
        braking = brake if brake_lag < 1e-6 else brake + (braking - brake) * np.exp(-STEP_S / brake_lag)
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
            push = late * (1.0 - loss) * passed + steady
            resist = (
                viscous * at * max(abs(at), 1e-3) ** power
                + square * at * abs(at)
                + (reverse * at if at < 0.0 else 0.0)
            )
            dry = mass * G * (rolling + stribeck * np.exp(-abs(at)))
            resist += (dry + braking * (1.0 - fade)) * at / np.sqrt(at * at + 0.05**2)
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
    intervals: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    keep: int = KEEP,
    stamps: str = "",
) -> Recording:
    """Drive a random sequence of target speeds; truth: parameters by the model's names, mass and sensors included, and those of STRUCTURE and _spoilt.

    keep: one of so many steps is recorded; stamps: of bench.proof.stamps. interval: the time [s] in which the effects act; else always. intervals: the same for single effects, by parameter.
    """
    n = int(duration_s / STEP_S)
    always = np.array([truth.get(name, 0.0) if name in STANDING else 0.0 for name in ORDER])
    effects = np.array([0.0 if name in STANDING else truth.get(name, 0.0) for name in ORDER])
    at, acts = STEP_S * np.arange(n), np.ones((n, len(ORDER)))
    spells = intervals or (dict.fromkeys(ORDER, (interval,)) if interval else {})
    for name, times in spells.items():
        inside = [(at >= start) & (at < end) for start, end in times]
        acts[:, ORDER.index(name)] = np.any(inside, axis=0)
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
    if "contact" in truth:  # something stands in the way for three seconds
        start = int(truth["contact_at"] * n)
        shake[start : start + round(3.0 / STEP_S)] -= truth["contact"]
    reading = rng.normal(0.0, noise.speed_sd, n)
    sense = np.array([truth.get("speed.scale", 0.0), truth.get("speed.delay", 0.0) / STEP_S])
    structure = np.array([truth.get(name, 0.0) for name in STRUCTURE])
    # generators of their own: the same arm without the difference, or with other stamps, has the same drive and noise
    own, times = rng.spawn(2)
    controlled = np.zeros(n, bool)
    controlled[[0, *stamped(n, BETWEEN if stamps else CONTROLLED, stamps, times)]] = True
    out = _drive(always, effects, acts, target, shake, reading, sense, structure, controlled)
    time_s = STEP_S * np.arange(n)
    rows = stamped(n, keep, stamps, times)
    given = np.flatnonzero(controlled) if stamps else rows
    wheel = np.interp(time_s - truth.get("speed.delay", 0.0), time_s, out[1]) * (1.0 + sense[0]) + reading
    # The accelerometer averages over 10 ms from its stamp on, as the model does in a step. It stops at a command that comes within: an output that
    # jumps with a command is read at one instant.
    later = np.append(out[2, 1:], out[2, -1])
    acceleration = np.where(np.append(controlled[1:], False), out[2], 0.5 * (out[2] + later))
    force = acceleration + G * np.sin(acts[:, ORDER.index("slope")] * truth.get("slope", 0.0))
    force = force * (1.0 + truth.get("acceleration.scale", 0.0)) + truth.get("acceleration.bias", 0.0)
    force = force + rng.normal(0.0, noise.acceleration_sd, n)
    wheel, force = _spoilt(truth, time_s, wheel, force, out, own)
    if noise.quantised:
        # 1/256 km/h and 0.01 m/s²: resolutions usual in J1939 messages
        wheel, force = np.round(wheel * 256.0 * 3.6) / 256.0 / 3.6, np.round(force / 0.01) * 0.01
    return Recording(
        "straight",
        {
            "drive_force": signal(time_s[given], out[3, given], "N", held=True),
            "brake_force": signal(time_s[given], out[4, given], "N", held=True),
            "speed": signal(time_s[rows], wheel[rows], "m/s"),
            "acceleration": signal(time_s[rows], force[rows], "m/s^2"),
        },
    )


def _spoilt(
    truth: Mapping[str, float],
    time_s: np.ndarray,
    wheel: np.ndarray,
    force: np.ndarray,
    out: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """What real sensors add: a pitch that follows the acceleration, a wheel out of round, a wandering zero, another clock, outliers."""
    if "squat" in truth:
        a = STEP_S / 0.3  # the suspension's tyres settle within 0.3 s
        force = force + G * truth["squat"] * lfilter([a], [1.0, a - 1.0], out[2])
    if "out_of_round" in truth:
        wheel = wheel * (1.0 + truth["out_of_round"] * np.sin(np.cumsum(out[0]) * STEP_S / WHEEL_M))
    if "wander" in truth:
        a = np.exp(-STEP_S / 2.0)
        wheel = wheel + lfilter(
            [np.sqrt(1.0 - a * a)], [1.0, -a], rng.normal(0.0, truth["wander"], time_s.size)
        )
    if "drift" in truth:
        force = np.interp(time_s * (1.0 + truth["drift"]), time_s, force)
    if "outliers" in truth:
        wrong = rng.random(time_s.size) < truth["outliers"]
        wheel = np.where(wrong, wheel + rng.normal(0.0, 1.0, time_s.size), wheel)
    return wheel, force
