"""Inputs of the estimators without a plant: smooth motions with noise, and stretches in which sensors fail."""

import numpy as np

from ecu.estimators.signals import Inputs

FAILING = (
    "rates_usable",
    "acceleration_usable",
    "slope_usable",
    "pressure_usable",
    "torque_usable",
    "wheel_1_usable",
    "demand_usable",
)


def driven_rows(generator, cycles=300, failing=60):
    """Consecutive cycles, (n, inputs): `cycles` with every sensor, then `failing` without each of FAILING in turn."""
    n = cycles + failing * len(FAILING)
    t = 0.01 * np.arange(n)
    values = {name: np.zeros(n) for name in Inputs._fields}
    a, b, c = generator.uniform(0.5, 1.5, 3)

    def noisy(smooth, deviation):
        return smooth + deviation * generator.normal(size=n)

    values["dt"][:] = 0.01
    values["articulation_angle"] = noisy(0.45 * np.sin(a * t), 3e-4)
    values["articulation_rate"] = noisy(0.45 * a * np.cos(a * t), 2e-3)
    values["articulation_rate_demand"] = 0.45 * a * np.cos(a * t + 0.1)
    # levers at rest in between, so that both branches of the prediction are taken
    values["lift_demand"] = np.clip(1.5 * np.sin(b * t), -1.0, 1.0) * (np.sin(3 * t) > 0.0)
    values["tilt_demand"] = np.clip(1.5 * np.cos(c * t), -1.0, 1.0) * (np.cos(2 * t) > 0.3)
    for wheel in range(1, 5):
        values[f"wheel_speed_{wheel}"] = noisy(5.0 + 2.0 * np.sin(0.4 * t), 0.01)
        values[f"wheel_torque_{wheel}"] = noisy(4000.0 * np.sin(b * t), 60.0)
    values["specific_force_x"] = noisy(1.2 * np.cos(b * t), 0.03)
    values["specific_force_y"] = noisy(3.0 * np.sin(a * t), 0.03)
    values["specific_force_z"] = noisy(np.full(n, 9.8), 0.05)
    for name, deviation in (("roll_rate", 0.01), ("pitch_rate", 0.01)):
        values[name] = noisy(0.05 * np.sin(4.0 * t), deviation)
    values["yaw_rate"] = noisy(0.6 * np.sin(a * t), 1e-3)
    values["pitch"], values["roll"] = noisy(0.05 * np.sin(t), 1e-3), noisy(0.08 * np.cos(t), 1e-3)
    values["lift_pressure"] = noisy(9e6 + 4e6 * np.sin(c * t), 2.5e4)
    values["tilt_pressure"] = np.maximum(noisy(3e6 + 3.2e6 * np.cos(b * t), 2.5e4), 0.0)
    # the linkage's angles come every second cycle
    for name, angle in (
        ("lift_arm_angle", 0.6 * np.sin(0.5 * t)),
        ("tilt_angle", 0.2 + 0.5 * np.sin(0.8 * t)),
    ):
        values[name] = np.repeat(noisy(angle, 5e-4)[::2], 2)[:n]
    for name in Inputs._fields:
        if name.endswith("_usable"):
            values[name][:] = 1.0
    for k, name in enumerate(FAILING):
        values[name][cycles + k * failing : cycles + (k + 1) * failing] = 0.0
    values["rate_limit"] = np.where(np.sin(2 * t) > 0.0, 0.89, 0.3)
    for name in ("lift_up_limit", "lift_down_limit", "tilt_back_limit", "tilt_forward_limit"):
        values[name] = np.where(np.sin(5 * t) > 0.0, np.inf, 0.2)
    return np.stack([values[name] for name in Inputs._fields], axis=1)
