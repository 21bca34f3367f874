"""A ball thrown before a camera: truth by an adaptive method of order 8 (DOP853), pixels and an unsure scale."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from bench.proof.arm import Arm
from bench.proof.body import Body
from bench.proof.stamps import rows
from discrepancy.models.ball import model
from discrepancy.signals.recording import Recording, signal

G, AIR, VISCOSITY = 9.81, 1.2, 1.8e-5
PICTURES_HZ = 60.0
FINER = 20  # steps of the truth to a picture
PIXEL_M = 0.01
NOISE_M = 0.01
THROWS = ((45.0, 0.0, 2.6), (2.0, 18.0, 3.2), (30.0, 8.0, 3.0))  # height [m], speed [m/s], duration [s]
BALLS = ((0.045, 0.073), (0.058, 0.066), (0.020, 0.090))  # mass [kg], diameter [m]


def recorded(values, arm: Arm, rng: np.random.Generator, pictures_hz: float = PICTURES_HZ) -> list[Recording]:
    """Three throws of one ball, all with one error of the camera's scale."""
    mass, diameter = BALLS[int(rng.integers(len(BALLS)))]
    camera = 1.0 + 0.02 * rng.normal()
    return [
        _throw(values, arm, rng, f"throw {i}", (mass, diameter, camera), throw, pictures_hz)
        for i, throw in enumerate(THROWS, 1)
    ]


def _throw(
    values, arm: Arm, rng: np.random.Generator, name: str, ball, throw, pictures_hz: float
) -> Recording:
    (mass, diameter, camera), (height, speed, duration) = ball, throw
    # mass of the displaced air [kg], for buoyancy and added mass
    displaced = AIR * np.pi * diameter**3 / 6.0
    square = 0.5 * AIR * np.pi / 4.0 * diameter**2 * values.get("drag_coefficient", 0.0)
    linear = 3.0 * np.pi * VISCOSITY * diameter * values.get("stokes", 0.0)
    inertia = mass + values.get("added_mass", 0.0) * displaced
    gust = values.get("gust", 0.0)
    # laws of the wild arms: a drag of another power, a wind that grows with height, lift of a spin that dies away
    power, shear, spin = values.get("power", 0.0), values.get("shear", 0.0), values.get("spin", 0.0)

    def rates(t, y):
        v = y[1] - shear * y[0]
        wind = gust * np.sin(2.0 * np.pi * 0.8 * t)  # an updraught that comes and goes
        force = (
            -mass * G
            + values.get("buoyancy", 0.0) * displaced * G
            - square * v * abs(v) * max(abs(v) / 10.0, 1e-3) ** power
            - linear * v
            + mass * (wind + spin * np.exp(-t) * abs(v))
        )
        return y[1], force / inertia

    # twenty times finer than the pictures: the linear interpolation between is then below the noise
    fine = np.arange(0.0, duration, 1.0 / (FINER * pictures_hz))
    (own,) = rng.spawn(1)  # other stamps have the same noise
    at = rows(fine.size, FINER, arm.stamps, own)
    time_s = fine[at - at[0]]  # the first picture is of the release, by which a late one is measured
    z = solve_ivp(rates, (0.0, duration), (height, speed), "DOP853", t_eval=fine, rtol=1e-9, atol=1e-9).y[0]
    seen = np.interp(np.maximum(fine - values.get("release", 0.0), 0.0), fine, z)
    seen = np.interp(time_s, fine, _low_passed(seen, values.get("height.lag", 0.0), fine[1])) * camera
    seen = _filmed(values, rng, time_s, seen)
    noise = NOISE_M * rng.normal(size=seen.size)
    if arm.noise == "coloured":
        # the factor keeps the variance: coloured noise is as large as white
        noise = lfilter([np.sqrt(1.0 - 0.8**2)], [1.0, -0.8], noise)
    seen = seen + noise
    if arm.noise == "quantised":
        seen = np.round(seen / PIXEL_M) * PIXEL_M
    return Recording(name, {"height": signal(time_s, seen, "m")}, {"mass": mass, "diameter": diameter})


def _filmed(values, rng: np.random.Generator, time_s: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """What real cameras add: a scale that changes over the picture, pictures at other times than they say, a wrong ball."""
    if "lens" in values:
        middle = 0.5 * (seen.max() + seen.min())
        seen = seen + values["lens"] * (seen - middle) ** 3 / max(np.ptp(seen), 1.0) ** 2
    if "jitter" in values:
        seen = np.interp(time_s + values["jitter"] * rng.normal(size=time_s.size), time_s, seen)
    if "outliers" in values:
        wrong = rng.random(seen.size) < values["outliers"]
        seen = np.where(wrong, seen + rng.normal(0.0, 2.0, seen.size), seen)
    return seen


def _low_passed(values: np.ndarray, time_constant_s: float, step_s: float) -> np.ndarray:
    """First-order lag by the trapezoidal rule, settled at the start."""
    if time_constant_s <= 0.0:
        return values
    a = step_s / (2.0 * time_constant_s + step_s)
    return lfilter([a, a], [1.0, 2.0 * a - 1.0], values, zi=[(1.0 - a) * values[0]])[0]


BALL = Body(
    name="ball",
    model=model,
    record=recorded,
    noises=("white", "coloured", "quantised"),
    nulls=100,
    outside={"updraught 0.3 g": {"gust": 0.3 * G}, "updraught 0.6 g": {"gust": 0.6 * G}},
    pairs=(("quadratic drag", "late release"), ("late release", "height lag")),
)
