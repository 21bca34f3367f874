"""The correction of a fit for noise of the measured inputs.

The replay takes measured torques and joint angles as exact. Their noise looks like motion: it gives an inertia a sensitivity in a drive in which
nothing turns, and draws its estimate towards zero (regression dilution). Drives with the noise of the sheet added once more show by how much:
what the derivatives J and the prediction f then change by, dJ and df, has the size that it already has in them. The corrected score
(Nakamura 1990) takes dJ'dJ from the information and dJ'df from the score.

A direction in which half of the information was noise has a score that scatters as before, over a slope half as large: its estimate has four
times the variance of the naive one, and counts by that. A direction in which all was noise keeps its prior.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.fit import Fit, differences
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model
from discrepancy.models.loader.channels import INPUTS
from discrepancy.signals.recording import Recording
from plant.unit.sensor_parameters import SensorParameters

Array = NDArray[np.float64]

DRAWS: Final = 4  # of the added noise; each costs one set of derivatives
SEED: Final = 0  # the same recordings give the same result


def corrected(
    problem: Problem,
    noise: Noise,
    fitted: Fit,
    build: Callable[[Sequence[Recording]], Model],
    sensors: SensorParameters,
) -> Fit:
    """The fit with values and information corrected; build: the model of the problem for other recordings with the same windows."""
    random, values = np.random.default_rng(SEED), fitted.values
    rows = problem.predict(values)
    columns = noise.whiten(differences(problem, values, rows, fitted.names))
    k = len(fitted.names)
    false_information, false_score = np.zeros((k, k)), np.zeros(k)
    for _ in range(DRAWS):
        noisier = [_noisier(r, sensors, random) for r in problem.recordings]
        other = Problem(_same_windows(build(noisier), problem), noisier)
        moved = other.predict(values)
        d_columns = noise.whiten(differences(other, values, moved, fitted.names)) - columns
        false_information += d_columns.T @ d_columns / DRAWS
        false_score += d_columns.T @ noise.whiten(moved - rows) / DRAWS
    data = columns.T @ columns
    prior = fitted.information - fitted.columns.T @ fitted.columns
    score = columns.T @ noise.whiten(problem.measured - rows)
    sure, sure_score = reliable(data, false_information, score + false_score, prior)
    information = sure + prior
    # score and prior of the fit cancel, where it ended at its optimum
    step = np.linalg.solve(information, sure_score - score)
    at = {}
    for name, change in zip(fitted.names, step.tolist(), strict=True):
        p = problem.model.parameter(name)
        at[name] = float(np.clip(values.shared[name] + change, p.lower, p.upper))
    return replace(fitted, values=values.with_shared(at), information=information)


def _noisier(r: Recording, sensors: SensorParameters, random: np.random.Generator) -> Recording:
    """The recording with the noise of the sheet added to its inputs once more."""
    added = {
        name: replace(s, value=s.value + sensors.of(name).noise * random.standard_normal(s.value.size))
        for name, s in r.signals.items()
        if name in INPUTS
    }
    return replace(r, signals={**r.signals, **added})


def _same_windows(model: Model, problem: Problem) -> Model:
    """The model with the windows of a problem: noise must not choose others."""

    def windows(recording: Recording, _: tuple[float, float]) -> list[tuple[float, float]]:
        return [(w.start_s, w.end_s) for w in problem.windows if w.recording == recording.name]

    return replace(model, segments=windows)


def reliable(data: Array, false: Array, score: Array, prior: Array) -> tuple[Array, Array]:
    """Information of data (k, k) and their score (k,) without the false part, by what of each direction is no noise.

    data: information as computed, of which `false` is noise; prior: information, for the size of each parameter.
    """
    # in units of the prior's standard deviations, so that kilograms and radians weigh alike; without a prior, of the data's own
    size = np.sqrt(np.where(np.diag(prior) > 0.0, np.diag(prior), np.maximum(np.diag(data), 1e-300)))
    scaled = (data - false) / np.outer(size, size)
    true, directions = np.linalg.eigh(0.5 * (scaled + scaled.T))
    whole = np.einsum("ji,jk,ki->i", directions, data / np.outer(size, size), directions)
    true = np.maximum(true, 0.0)
    share = np.minimum(true / np.maximum(whole, 1e-300), 1.0)
    information = (directions * (share * true)) @ directions.T
    kept = directions @ (share * (directions.T @ (score / size)))
    return information * np.outer(size, size), kept * size
