"""Recordings with a known truth: a model with hidden effects, parameter errors, noise and faults, simulated at a finer step than it is fitted with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from bus.user_error import UserError
from discrepancy.checks.model_check import check_model
from discrepancy.estimation.problem import Problem, Unusable, Values
from discrepancy.model.description import Effect, Manoeuvre, Model, Parameter
from discrepancy.signals.recording import Array, Recording, Signal

FINER = 5  # steps of the truth in one of the model's
DEFAULT_NOISE = 0.01  # of a channel's own spread
FASTEST_HZ = 50.0
SIZES = (0.7, 3.0)  # of an effect's typical change, where the size is drawn
FAINT = 0.1  # of a typical change: what is smaller, hardly any recording shows
TIMED = ("stuck", "gap")
KINDS = ("lost", "damaged", "spikes", "stuck", "gap")


class NotHidden(UserError, ValueError):
    """What was to be hidden cannot be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of one channel. lost, damaged, spikes: share of its samples; stuck, gap: from start_s to end_s."""

    channel: str
    kind: str
    share: float = 0.0
    start_s: float = 0.0
    end_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What is hidden. effects: parameters by effect; nuisances: true values of baseline parameters;

    noise: standard deviation by channel, in its unit; memory: of the noise from sample to sample, 0 (white) to below 1.
    """

    model: str
    seed: int
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    nuisances: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    memory: float = 0.0
    faults: Sequence[Fault] = ()


def chosen(model: Model, name: str, sizes: Sequence[float]) -> dict[str, float]:
    """Parameters of an effect at given sizes, at their typical ones if none is given. Raises NotHidden."""
    effect = _effect(model, name)
    if not sizes:
        return {p.name: _bounded(p, p.value + p.typical) for p in effect.parameters}
    if len(sizes) != len(effect.parameters):
        names = ", ".join(p.name for p in effect.parameters[:5])
        raise NotHidden(f"{name} has {len(effect.parameters)} parameters ({names}), not {len(sizes)}")
    for p, size in zip(effect.parameters, sizes, strict=True):
        if not p.lower <= size <= p.upper:
            raise NotHidden(
                f"{name}: {p.name}={size:g} {p.unit} is outside [{p.lower:g}, {p.upper:g}] {p.unit}"
            )
    return {p.name: size for p, size in zip(effect.parameters, sizes, strict=True)}


def faint(model: Model, effects: Mapping[str, Mapping[str, float]]) -> list[str]:
    """A line for each effect that is there but so small that nobody should expect to see it."""
    lines = []
    for name, values in effects.items():
        shares = {
            p: abs(values[p.name] - p.value) / p.typical for p in model.effect(name).parameters if not p.shape
        }
        largest = max(shares, key=lambda p: shares[p], default=None)
        if largest is not None and shares[largest] < FAINT:
            lines.append(
                f"{name}: {largest.name}={values[largest.name]:g} is {shares[largest]:.0%} of its typical {largest.typical:g} {largest.unit}: "
                "hardly any recording shows that"
            )
    return lines


def drawn(model: Model, count: int, rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """So many effects by chance, each from about its typical size to three times that, in the direction its bounds allow."""
    if count > len(model.effects):
        raise NotHidden(f"{count} effects were asked for, {model.name} has {len(model.effects)}")
    found = {}
    for i in sorted(rng.choice(len(model.effects), count, replace=False).tolist()):
        effect = model.effects[i]
        found[effect.name] = {
            p.name: _bounded(p, p.value + p.typical * rng.uniform(*SIZES)) for p in effect.parameters
        }
    return found


def _bounded(p: Parameter, value: float) -> float:
    return float(np.clip(value, p.lower, p.upper))


def _effect(model: Model, name: str) -> Effect:
    try:
        return model.effect(name)
    except KeyError as error:
        raise NotHidden(str(error.args[0])) from error


def staged(model: Model, manoeuvre: Manoeuvre, constants: Mapping[str, float]) -> Recording:
    """A manoeuvre as a recording without outputs: their stamps are there, their values are not."""
    step = max(model.step_s, 1.0 / FASTEST_HZ)
    stamps = np.asarray(step * np.arange(int(manoeuvre.duration_s / step) + 1), float)
    # a ramp stands for what is not known yet; a constant would be called a dead sensor
    empty = {name: Signal(stamps, stamps.copy(), unit) for name, unit in model.outputs.items()}
    return Recording(manoeuvre.name, {**empty, **manoeuvre.inputs}, constants)


def concealed(
    model: Model, basis: Recording, truth: Truth, initial: Mapping[str, float] | None = None
) -> Recording:
    """The basis with its outputs replaced by the truth's, seen through noise and faults.

    initial: initial states, guessed from the basis' own outputs where not given. Raises NotHidden.
    """
    _check(model, truth)
    rng = np.random.default_rng(truth.seed)
    signals = dict(basis.signals)
    for name, signal in _simulated(model, basis, truth, initial or {}).items():
        spread = float(np.std(signal.value)) or float(np.mean(np.abs(signal.value)))
        sd = truth.noise.get(name, DEFAULT_NOISE * spread)
        noisy = signal.value + _noise(rng, signal.value.size, sd, truth.memory)
        faults = [f for f in truth.faults if f.channel == name]
        _check_times(faults, signal)
        signals[name] = _faulty(replace(signal, value=noisy), faults, rng)
    return replace(basis, signals=signals)


def _check(model: Model, truth: Truth) -> None:
    """Raises NotHidden for a baseline parameter or noise that the model cannot have."""
    nuisances = {p.name: p for p in model.nuisances if p.scope == "all"}
    for name, value in truth.nuisances.items():
        p = nuisances.get(name)
        if p is None:
            known = ", ".join(nuisances) or "none"
            raise NotHidden(f"{model.name} has no baseline parameter '{name}'; it has {known}")
        if not p.lower <= value <= p.upper:
            raise NotHidden(f"{name}={value:g} {p.unit} is outside [{p.lower:g}, {p.upper:g}] {p.unit}")
    for name, sd in truth.noise.items():
        if name not in model.outputs:
            raise NotHidden(
                f"noise of {name}: {model.name} has no such output; it has {', '.join(model.outputs)}"
            )
        if not 0.0 <= sd < np.inf:
            raise NotHidden(
                f"noise of {name}: {sd:g} {model.outputs[name]} is no standard deviation; 0 or more is"
            )


def _check_times(faults: Sequence[Fault], signal: Signal) -> None:
    """Raises NotHidden for a fault from one time to another that would strike no sample."""
    for fault in [f for f in faults if f.kind in TIMED]:
        within = (signal.time_s >= fault.start_s) & (signal.time_s <= fault.end_s)
        if not within.any():
            raise NotHidden(
                f"{fault.channel}:{fault.kind}={fault.start_s:g}..{fault.end_s:g} s strikes no sample; "
                f"there are some from {signal.time_s[0]:g} to {signal.time_s[-1]:g} s"
            )


def _simulated(
    model: Model, basis: Recording, truth: Truth, initial: Mapping[str, float]
) -> dict[str, Signal]:
    finer = replace(model, window_s=None, lead_s=0.0, step_s=model.step_s / FINER)
    try:
        problem = Problem(finer, [basis])
    except Unusable as error:
        raise NotHidden(f"cannot simulate: {error}") from error
    check_model(problem)
    start = problem.start()
    local = {name: np.full(values.size, initial.get(name, values[0])) for name, values in start.local.items()}
    on = {name: value for parameters in truth.effects.values() for name, value in parameters.items()}
    values = Values({**start.shared, **truth.nuisances, **on}, local)
    # measured outputs must not drive what is simulated in their place
    inputs = {**model.inputs, **model.optional}
    problem.windows = [
        replace(w, known={n: v for n, v in w.known.items() if n in inputs}) for w in problem.windows
    ]
    rows = problem.predict(values)
    if not np.isfinite(rows).all():
        raise NotHidden("the simulation with these effects does not stay finite; make them smaller")
    found = {}
    for i, name in enumerate(problem.channels):
        mine = problem.row_channel == i
        order = np.argsort(problem.row_time[mine])
        stamps = problem.row_time[mine][order]
        found[name] = Signal(stamps, rows[mine][order], model.outputs[name])
    return found


def _noise(rng: np.random.Generator, count: int, sd: float, memory: float) -> Array:
    white = rng.normal(0.0, sd * np.sqrt(1.0 - memory**2), count)
    start = [memory * rng.normal(0.0, sd)]
    return np.asarray(lfilter([1.0], [1.0, -memory], white, zi=start)[0], float)


def _faulty(signal: Signal, faults: Sequence[Fault], rng: np.random.Generator) -> Signal:
    for fault in faults:
        time_s, value = signal.time_s, signal.value.copy()
        hit = rng.random(value.size) < fault.share
        within = (time_s >= fault.start_s) & (time_s <= fault.end_s)
        kept = np.ones(value.size, bool)
        if fault.kind == "lost":
            kept = ~hit
        elif fault.kind == "damaged":
            value[hit] = np.nan
        elif fault.kind == "spikes":
            value[hit] += rng.choice([-1.0, 1.0], np.count_nonzero(hit)) * 10.0 * np.std(value)
        elif fault.kind == "stuck":
            value[within] = value[within][0]
        elif fault.kind == "gap":
            kept = ~within
        signal = Signal(time_s[kept], value[kept], signal.unit, signal.held)
    return signal


def parsed_fault(model: Model, text: str) -> Fault:
    """'level:lost=0.05' or 'level:stuck=10..12'. Raises NotHidden."""
    channel, _, rest = text.partition(":")
    kind, _, size = rest.partition("=")
    if channel not in model.outputs:
        raise NotHidden(
            f"--fault '{text}': {model.name} has no output '{channel}'; it has {', '.join(model.outputs)}"
        )
    if kind not in KINDS:
        raise NotHidden(f"--fault '{text}': no fault '{kind}'; there are {', '.join(KINDS)}")
    try:
        if kind in TIMED:
            start, end = (float(part) for part in size.split(".."))
            return Fault(channel=channel, kind=kind, start_s=start, end_s=end)
        share = float(size)
    except ValueError as error:
        raise NotHidden(
            f"--fault '{text}': needs a share (lost=0.05) or a time (stuck=10..12) in seconds"
        ) from error
    if not 0.0 <= share <= 1.0:
        raise NotHidden(f"--fault '{text}': a share is 0 to 1")
    return Fault(channel=channel, kind=kind, share=share)
