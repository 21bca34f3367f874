"""pysindy on the benchmark's recordings, as well off as it can be: exact terms, nuisances projected out, best threshold in hindsight.

Two equations, both in m/s²: derivative of the recorded speed, and recorded acceleration, each minus the baseline at the recorded
speed and commands. Every effect of the library is one column over both, to first order.
"""

import warnings

import numpy as np

from discrepancy.models.straight import CORNER_M_S, MASS_KG, G
from discrepancy.signals.recording import Array, Recording

VISCOUS = 400.0  # kg/s, as the baseline has it
THRESHOLDS = np.geomspace(0.001, 0.5, 12)  # of the largest standardised coefficient


def terms_first(recording: Recording) -> frozenset[str]:
    """Effects that come out with the largest standardised coefficient at some threshold."""
    import pysindy

    speed, drive = recording.signals["speed"], recording.signals["drive_force"].value
    v, brake = speed.value, recording.signals["brake_force"].value
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        slope = pysindy.SmoothedFiniteDifference()
        dv = slope(v[:, None], speed.time_s)[:, 0]
        ddv = slope(dv[:, None], speed.time_s)[:, 0]
        columns, nuisances, target = _equations(recording, v, dv, ddv, drive, brake)
        # what mass and drag can explain is taken out, and both equations count by their scatter
        Q = np.linalg.qr(nuisances)[0]
        X = np.stack(list(columns.values()), axis=1)
        X, y = X - Q @ (Q.T @ X), target - Q @ (Q.T @ target)
        X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-12)
        # thresholds as shares of the largest coefficient: absolute ones would suit one drive only
        largest = float(np.max(np.abs(np.linalg.lstsq(X, y, rcond=None)[0])))
        found = set()
        for threshold in THRESHOLDS:
            optimizer = pysindy.STLSQ(threshold=threshold * largest, alpha=1e-6)
            coefficient = np.abs(optimizer.fit(X, y[:, None]).coef_[0])
            if coefficient.any():
                found.add(list(columns)[int(np.argmax(coefficient))])
    return frozenset(found)


def _equations(
    recording: Recording, v: Array, dv: Array, ddv: Array, drive: Array, brake: Array
) -> tuple[dict[str, Array], Array, Array]:
    """Columns by effect, nuisances (mass, drag), and the target, of both equations stacked and weighted."""
    smooth_sign = v / np.sqrt(v**2 + CORNER_M_S**2)
    baseline = (drive - brake * smooth_sign - VISCOUS * v) / MASS_KG
    of_speed, of_force = dv - baseline, recording.signals["acceleration"].value - baseline
    # both equations count alike: the derivative of a measured speed is far noisier
    weights = [1.0 / max(float(np.std(part)), 1e-9) for part in (of_speed, of_force)]
    step = float(np.median(np.diff(recording.signals["speed"].time_s)))
    nothing, one = np.zeros(v.size), np.ones(v.size)
    # to first order a lag is its time constant times the slope of what it delays
    late = -np.diff(drive, prepend=drive[:1]) / step / MASS_KG

    def both(first: Array, second: Array) -> Array:
        return np.concatenate([weights[0] * first, weights[1] * second])

    columns = {
        "rolling resistance": both(-G * smooth_sign, -G * smooth_sign),
        "slope": both(-G * one, nothing),
        "quadratic drag": both(-v * np.abs(v) / MASS_KG, -v * np.abs(v) / MASS_KG),
        "reverse drag": both(-v * (v < 0.0) / MASS_KG, -v * (v < 0.0) / MASS_KG),
        "brake fade": both(brake * smooth_sign / MASS_KG, brake * smooth_sign / MASS_KG),
        "motor lag": both(late, late),
        "drive loss": both(-drive / MASS_KG, -drive / MASS_KG),
        "wheel slip": both(np.gradient(v * drive, step) / (MASS_KG * G), nothing),
        "speed scale": both(dv, nothing),
        "speed delay": both(-ddv, nothing),
        "acceleration bias": both(nothing, one),
        "acceleration scale": both(nothing, baseline),
    }
    nuisances = np.stack(
        [both(-baseline / MASS_KG, -baseline / MASS_KG), both(-v / MASS_KG, -v / MASS_KG)], axis=1
    )
    return columns, nuisances, both(of_speed, of_force)
