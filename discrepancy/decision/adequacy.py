"""Is the model good enough? One-step and simulated errors of each channel over its budget, by time and by regime.

Asked for the baseline and for the model with everything that was accepted, before any verdict: an autoregression takes slow misfit
for noise, and innovations that are judged against themselves are always as small as they should be.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_dist

from discrepancy import gates
from discrepancy.checks.budgets import Budget, budgets
from discrepancy.decision.regimes import regimes_of
from discrepancy.estimation.fit import Fit, WindowStates, differences
from discrepancy.estimation.noise import Noise, estimate_noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.state import State
from discrepancy.signals.adequacy import ChannelAdequacy, ErrorPart, inadequate, left
from discrepancy.signals.recording import Array

PARTS: Final = 20  # of a recording's time, at most
SHOWN_REGIMES: Final = 3  # of a channel: those with the largest errors
LEAST: Final = 1e-300  # error of a reading, in place of none at all
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _Errors:
    """Errors of one model on the whitened rows (n,), in the channels' units."""

    one_step: Array
    simulated: Array


@dataclass(frozen=True, slots=True)
class _Part:
    """Some rows of all channels: a part of a recording's time, or a regime."""

    rows: Mask
    recording: str = ""
    start_s: float | None = None
    end_s: float | None = None
    regime: str = ""


def adequacy(problem: Problem, baseline: State, state: State) -> list[ChannelAdequacy]:
    """By channel; baseline: the state before anything was accepted. Costs two simulations and those of the initial states."""
    noise, base = state.noise, problem.predict(state.fit.values)
    allowed = budgets(problem, problem.measured - base)
    local = differences(problem, state.fit.values, base, problem.local_names, cached=True)
    scale = np.array([allowed[name].value for name in problem.channels])[problem.row_channel]
    states = WindowStates(local / scale[:, None], problem.row_window, noise.sound)
    start = baseline.fit.values.warmed_up_as(state.fit.values)
    after = _errors(problem, noise, state.fit.values, states, scale, len(state.fit.names))
    before = (
        _errors(problem, noise, start, states, scale, len(baseline.fit.names)) if state.accepted else after
    )
    moved = states.off(_within_windows(problem) / scale) * scale
    times, ranges = list(_times(problem, noise)), list(_ranges(problem, noise))
    return [
        _channel(problem, noise, i, allowed[name], _rms(moved[problem.row_channel == i]), before, after, times, ranges)
        for i, name in enumerate(problem.channels)
    ]  # fmt: skip


def first_look(problem: Problem, noise: Noise, fitted: Fit) -> str:
    """How good the baseline is, as one sentence, before any effect has been tried; noise: under which it was fitted."""
    residual = problem.measured - problem.predict(fitted.values)
    ahead = estimate_noise(problem, residual, len(fitted.names), noise)
    state = State(ahead, fitted, (), ())
    channels = adequacy(problem, state, state)
    beyond = inadequate(channels)
    if not beyond:
        return f"without any effect: every channel is within its error budget ({len(channels)} of {len(channels)})"
    several = len({w.recording for w in problem.windows}) > 1
    return (
        f"without any effect: {len(beyond)} of {len(channels)} channels beyond their error budgets; "
        f"{left(beyond[0], several=several)}"
    )


def _errors(
    problem: Problem, noise: Noise, values: Values, states: WindowStates, scale: Array, fitted: int
) -> _Errors:
    """Parameters that were fitted give their share of freedom back."""
    raw = problem.measured - problem.predict(values)
    raw = raw - noise.initial_part(raw)[0]
    used = min(fitted + states.used, 0.75 * raw.size)
    free = np.sqrt(raw.size / (raw.size - used))
    simulated = states.off(raw / scale) * scale
    return _Errors(free * one_step_errors(problem, noise, raw), free * simulated[noise.keep])


def one_step_errors(problem: Problem, noise: Noise, rows: Array) -> Array:
    """Errors (n,) of the prediction of each raw row (N,) from those before it, in the channels' units.

    The first rows of a block, which have no past to be predicted from, get the root mean square of the block's others that are kept.
    """
    found = []
    kept = np.zeros(problem.measured.size, bool)
    kept[noise.keep] = True
    for block in problem.blocks:
        whitener, (n, c) = noise.whiteners[block.group], block.shape
        white = whitener.apply(rows[block.start : block.stop].reshape(n, c, 1))[..., 0]
        errors = white @ np.linalg.inv(whitener.inverse_factor).T
        sound = errors[kept[block.start : block.stop].reshape(n, c)[n - len(errors) :, 0]]
        first = np.tile(
            np.sqrt(np.mean(sound**2, axis=0) if len(sound) else np.zeros(c)), (n - len(errors), 1)
        )
        found.append(np.concatenate([first, errors]).ravel())
    return noise.kept(np.concatenate(found))


def _within_windows(problem: Problem) -> Array:
    """Measured rows (N,) less their mean in each window: a constant is no movement."""
    rows = problem.measured.copy()
    group = problem.row_window * len(problem.channels) + problem.row_channel
    count = np.bincount(group)
    mean = np.bincount(group, rows) / np.maximum(count, 1)
    return np.asarray(rows - mean[group], float)


def _channel(
    problem: Problem,
    noise: Noise,
    channel: int,
    budget: Budget,
    movement: float,
    before: _Errors,
    after: _Errors,
    times: Sequence[_Part],
    ranges: Sequence[_Part],
) -> ChannelAdequacy:
    name, own = problem.channels[channel], noise.row_channel == channel
    share = gates.DISTURBANCE_SHARE.threshold * movement
    stated = problem.model.disturbances.get(name)
    simulated_budget = float(np.hypot(budget.value, share if stated is None else stated))
    # a measured budget is a lower bound of the noise: blur grows with speed, vibration with load
    firm = budget.source == "sensor sheet"
    one_step_budget = float(np.hypot(budget.value, stated or 0.0)) if firm else None
    limits = one_step_budget or np.inf, simulated_budget
    asked = 2 * len(problem.channels)
    good = all(
        _rms(error[own]) <= gate.threshold * limit or not _beyond_chance(error[own], limit, budget, asked)
        for error, limit, gate in (
            (after.one_step, limits[0], gates.ONE_STEP_OVER),
            (after.simulated, limits[1], gates.SIMULATED_OVER),
        )
    )
    asked *= len(times) + len(ranges)
    parts = [p for t in times if (p := _part(t, own, before, after, limits, budget, asked))]
    regimes = [p for r in ranges if (p := _part(r, own, before, after, limits, budget, asked))]
    regimes.sort(key=lambda p: -max(p.one_step / limits[0], p.simulated / limits[1]))
    return ChannelAdequacy(
        channel=name,
        unit=problem.model.outputs[name],
        budget=budget.value,
        source=budget.source,
        movement=movement,
        one_step_budget=one_step_budget,
        simulated_budget=simulated_budget,
        one_step_before=_rms(before.one_step[own]),
        one_step=_rms(after.one_step[own]),
        simulated_before=_rms(before.simulated[own]),
        simulated=_rms(after.simulated[own]),
        adequate=good and not any(p.over for p in (*parts, *regimes)),
        parts=parts,
        regimes=regimes[:SHOWN_REGIMES],
    )


def _part(
    part: _Part, own: Mask, before: _Errors, after: _Errors, limits: tuple[float, float], budget: Budget, asked: int
) -> ErrorPart | None:  # fmt: skip
    """The errors in a part, None where it has too few samples to ask."""
    rows = part.rows & own
    if np.count_nonzero(rows) < gates.SAMPLES_IN_A_BLOCK.threshold:
        return None
    errors = after.one_step[rows], after.simulated[rows]
    over = any(
        _rms(error) > gates.PART_OVER.threshold * limit and _beyond_chance(error, limit, budget, asked)
        for error, limit in zip(errors, limits, strict=True)
    )
    return ErrorPart(
        recording=part.recording,
        start_s=part.start_s,
        end_s=part.end_s,
        regime=part.regime,
        one_step_before=_rms(before.one_step[rows]),
        one_step=_rms(errors[0]),
        simulated_before=_rms(before.simulated[rows]),
        simulated=_rms(errors[1]),
        over=over,
    )


def _beyond_chance(errors: Array, limit: float, budget: Budget, asked: int) -> bool:
    """Whether a variance ratio as large as this is rarer than a false alarm over all that is asked (Fisher's F)."""
    alike = float(errors[1:] @ errors[:-1]) / max(float(errors @ errors), 1e-300)
    independent = max(errors.size * (1.0 - alike**2) / (1.0 + alike**2), 1.0)
    chance = gates.FALSE_ALARM.threshold / asked
    return bool(_rms(errors) ** 2 > limit**2 * f_dist.isf(chance, independent, budget.freedom))


def _times(problem: Problem, noise: Noise) -> Iterator[_Part]:
    """Equal parts of each recording's time, as many as leave enough samples of every channel in each."""
    owner = np.array([w.recording for w in problem.windows])[noise.row_window]
    for recording in dict.fromkeys(w.recording for w in problem.windows):
        rows = owner == recording
        fewest = min(c for c in np.bincount(noise.row_channel[rows]).tolist() if c)
        count = int(np.clip(fewest // gates.SAMPLES_IN_A_BLOCK.threshold, 1, PARTS))
        time_s = noise.row_time[rows]
        edges = np.linspace(float(time_s.min()), float(time_s.max()), count + 1)
        at = np.clip(np.digitize(noise.row_time, edges) - 1, 0, count - 1)
        for i in range(count):
            yield _Part(rows & (at == i), recording, float(edges[i]), float(edges[i + 1]))


def _ranges(problem: Problem, noise: Noise) -> Iterator[_Part]:
    """Thirds of the range of every known signal."""
    model = problem.model
    units = {**model.inputs, **model.optional, **{c: model.outputs[c] for c in problem.channels}}
    for name in [n for n in units if all(w.has(n) for w in problem.windows)]:
        unit, found = regimes_of(problem, noise, name, units[name])
        for text, rows in found.items():
            yield _Part(rows, regime=f"{name} {text} {unit}".rstrip())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def certain(problem: Problem, channels: Sequence[ChannelAdequacy]) -> bool:
    """Whether the model is right enough to call a value of its sheet wrong: within what disturbances are stated to do, else as good as a reading.

    What is granted for disturbances that nobody stated may be another law, for which the value stands. Nor may a budget by standstill, under
    constant commands, hold more than the sensor's noise.
    """
    return all(c.adequate for c in channels) and not granted(problem, channels)


def granted(problem: Problem, channels: Sequence[ChannelAdequacy]) -> list[ChannelAdequacy]:
    """Channels within their budgets only because a tenth of their movement is granted for disturbances that nobody stated, the furthest first."""
    found = [
        c
        for c in channels
        if c.adequate
        and c.channel not in problem.model.disturbances
        and c.simulated > gates.CERTAIN_VALUE.threshold * reading_error(c)
    ]
    return sorted(found, key=lambda c: -c.simulated / reading_error(c))


def reading_error(c: ChannelAdequacy) -> float:
    """What a reading is off by: its budget; what is left of it one step ahead where that is more, or where something slow was taken for a standstill."""
    return max(c.one_step, LEAST if c.source == "standstill" else c.budget)
