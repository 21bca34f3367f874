"""Grip of the rear axle, lag of the steering, delays of gyro and encoder: each with intervals under coloured noise."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from discrepancy.estimation.autoregression import Whitener
from identify.car.log import CarLog
from identify.car.motion import CUTOFF_HZ, RATE_HZ, Body
from identify.car.regression import Regression, blocks
from identify.signals.filters import low_pass
from identify.tyre.curve import steady
from identify.tyre.estimate import Estimate, Noise, estimate
from identify.tyre.rig_problem import Unknown

Array = NDArray[np.float64]

AVERAGED = 5  # rows of 100 Hz in one row of a fit
SHAPE, SHAPE_SD = 1.4, 0.25  # of a lateral curve: what tyres have
SETTLED = 20.0  # yaw acceleration [rad/s²] beyond which an assumed inertia would make much of an axle's force


def grip(body: Body, axle: str) -> Estimate:
    """Lateral curve of an axle over its weight: 'stiffness' per radian, 'grip' (its peak), 'shape', 'zero' [rad]. Raises ValueError.

    axle: 'rear', or 'front' for a drive with the steering held, whose angle is then the zero. A car that understeers slides in front: only there
    does it reach the peak. Only slips that a car hardly reaches distinguish shape from peak, so the shape has a prior.
    """
    turning = np.abs(np.gradient(low_pass(body.yaw_rate, RATE_HZ, CUTOFF_HZ, 2), 1.0 / RATE_HZ))
    slip, force = {
        "rear": (body.rear_slip, body.rear_grip),
        "front": (-body.front_direction, body.front_grip),
    }[axle]
    slip, force = slip[::AVERAGED], force[::AVERAGED]
    spans = blocks((body.kept & (turning < SETTLED))[::AVERAGED], 20)
    if not spans:
        raise ValueError("the car hardly moves: no grip can be found")

    def predict(v: Mapping[str, float]) -> Sequence[Array]:
        curve = np.array([v["stiffness"], v["shape"], v["grip"], 0.0, 0.0, v["zero"], 0.0])
        force_, by = np.empty(slip.size), np.empty((slip.size, 7))
        steady(np.tile(curve, (slip.size, 1)), slip, force_, by)
        return [force_[s] for s in spans]

    at_start = -1.5 * float(np.median(slip[spans[0]])) if axle == "front" else 0.0
    unknowns = [
        Unknown(name="stiffness", start=8.0, lower=1.0, upper=100.0, typical=2.0),
        Unknown(name="grip", start=0.5, lower=0.05, upper=3.0, typical=0.1),
        Unknown(name="shape", start=SHAPE, lower=1.0, upper=2.0, typical=0.1, prior=SHAPE, prior_sd=SHAPE_SD),
        Unknown(name="zero", start=at_start, lower=-0.8, upper=0.8, typical=0.02),
    ]
    # coloured noise would weigh the fast changes alone, and the curve is in the slow ones
    return _fitted(unknowns, predict, [force[s] for s in spans], white=True)


def sensor_delay(log: CarLog, body: Body, channel: str) -> Estimate:
    """'delay' [s], 'scale' and 'zero' of the gyro or the encoder against motion capture; only rows in which the sensor has a new reading count."""
    value = getattr(log, channel)
    truth = body.yaw_rate if channel == "gyro" else body.forward
    # both are read together: a reading that did not change is as new as that of the other
    fresh = np.flatnonzero((np.diff(log.gyro) != 0.0) | (np.diff(log.encoder) != 0.0)) + 1
    driving = np.interp(log.time[fresh], body.time, body.kept.astype(float)) > 0.5
    at, reading = log.time[fresh][driving], value[fresh][driving]
    spans = blocks(np.diff(at, prepend=at[0]) < 0.35, 20)

    def predict(v: Mapping[str, float]) -> Sequence[Array]:
        late = v["scale"] * np.interp(at - v["delay"], body.time, truth) + v["zero"]
        return [late[s] for s in spans]

    unknowns = [
        Unknown(name="delay", start=0.08, lower=-0.2, upper=0.5, typical=0.02),
        Unknown(name="scale", start=1.0, lower=0.5, upper=2.0, typical=0.02),
        Unknown(name="zero", start=0.0, lower=-1.0, upper=1.0, typical=0.02),
    ]
    return _fitted(unknowns, predict, [reading[s] for s in spans])


def steering_lag(log: CarLog, body: Body) -> Estimate:
    """'lag' and 'delay' [s] of the servo, the map from command to angle, and the front axle's slip per grip.

    The angle is where the front axle moves, plus its slip angle, a cubic of the force that it carries. The command passes the same filter as the motion.
    """
    command = np.interp(body.time, log.time, log.steering)
    spans = blocks(body.kept, 100)
    if not spans:
        raise ValueError("the car hardly moves: no steering angle can be found")

    def predict(v: Mapping[str, float]) -> Sequence[Array]:
        late = np.interp(body.time - v["delay"], body.time, command)
        a = float(np.exp(-1.0 / (RATE_HZ * max(v["lag"], 1e-3))))
        moved = lfilter([1.0 - a], [1.0, -a], late, zi=[a * late[0]])[0]
        steered = low_pass(v["gain"] * moved + v["cubic"] * moved**3 + v["offset"], RATE_HZ, CUTOFF_HZ, 2)
        g = body.front_grip
        direction = steered - v["slip per grip"] * g - v["slip per grip cubed"] * g**3
        return [direction[s][::AVERAGED] for s in spans]

    unknowns = [
        Unknown(name="lag", start=0.08, lower=0.005, upper=0.5, typical=0.02),
        Unknown(name="delay", start=0.02, lower=0.0, upper=0.3, typical=0.02),
        Unknown(name="gain", start=0.4, lower=-2.0, upper=2.0, typical=0.05),
        Unknown(name="cubic", start=0.0, lower=-2.0, upper=2.0, typical=0.05),
        Unknown(name="offset", start=0.0, lower=-0.3, upper=0.3, typical=0.01),
        Unknown(name="slip per grip", start=0.1, lower=-1.0, upper=1.0, typical=0.05),
        Unknown(name="slip per grip cubed", start=0.0, lower=-1.0, upper=1.0, typical=0.05),
    ]
    return _fitted(unknowns, predict, [body.front_direction[s][::AVERAGED] for s in spans])


def _fitted(
    unknowns: list[Unknown],
    predict: Callable[[Mapping[str, float]], Sequence[Array]],
    measured: list[Array],
    *,
    white: bool = False,
) -> Estimate:
    """Under coloured noise (or white), as large as the spread between blocks of rows."""
    problem = Regression(
        unknowns=unknowns,
        predict=predict,
        measured=measured,
        kept=[np.ones(m.size, bool) for m in measured],
    )
    found = estimate(problem, white=white)
    random = np.random.default_rng(0)
    ratio = max(1.0, *(found.bootstrap_sd(u.name, random) / found.interval(u.name).sd for u in unknowns))
    # once more with the noise as large as blocks of rows say, so that priors weigh against it as they should
    [size] = {id(w): w for w in found.noise.whiteners}.values()
    wider = Whitener(size.past, size.inverse_factor / ratio)
    return estimate(problem, found.values, noise=Noise([wider] * len(measured), found.noise.weights))
