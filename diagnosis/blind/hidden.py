"""Recordings with a known truth for blind tests: a model with hidden effects, parameter errors, noise and faults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from bus.user_error import UserError
from discrepancy.checks.model_check import check_model
from discrepancy.estimation.problem import Problem, Unusable, Values
from discrepancy.model.description import Effect, Manoeuvre, Model, Parameter
from discrepancy.signals.recording import Array, Recording, Signal

# The truth is integrated with smaller steps than the fitted model, so that the fit meets a discretisation error as it does
# with a real machine. With the same step the truth would lie in the model's own set ("inverse crime").
FINER = 5  # steps of the truth in one step of the model
DEFAULT_NOISE = 0.01  # standard deviation, as a share of the channel's own spread
FASTEST_HZ = (
    50.0  # sampling rate of a manoeuvre, at most; a finer step of the model would only make large files
)
# From somewhat below the typical size, where detection is uncertain, to a size that should be found.
SIZES = (0.7, 3.0)  # range of a random size, in typical changes of the effect
FAINT = 0.1  # in typical changes; hardly any recording shows a smaller effect
TIMED = ("stuck", "gap")  # kinds of fault with start and end instead of a share
KINDS = ("lost", "damaged", "spikes", "stuck", "gap")


class NotHidden(UserError, ValueError):
    """The effect, parameter, noise or fault cannot be hidden in this recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of one channel."""

    channel: str
    kind: str  # one of KINDS
    share: float = 0.0  # of the samples, 0 to 1; for lost, damaged and spikes
    start_s: float = 0.0  # in the recording's time; for stuck and gap
    end_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The hidden content of a recording; the sealed file holds these fields under these names."""

    model: str
    seed: int  # of noise, faults and random choices
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # parameters by effect
    nuisances: Mapping[str, float] = field(default_factory=dict)  # true values of baseline parameters
    noise: Mapping[str, float] = field(default_factory=dict)  # standard deviation by channel, in its unit
    memory: float = 0.0  # correlation of the noise from one sample to the next, 0 (white) to below 1
    faults: Sequence[Fault] = ()


def chosen(model: Model, name: str, sizes: Sequence[float]) -> dict[str, float]:
    """Parameters of an effect by name, at the given sizes or, without any, at their typical sizes. Raises NotHidden."""
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
    """One line for each effect that is too small for any diagnosis to be expected to find it."""
    lines = []
    for name, values in effects.items():
        shares = {
            p: abs(values[p.name] - p.value) / p.typical for p in model.effect(name).parameters if not p.shape
        }
        largest = max(shares, key=lambda p: shares[p], default=None)
        if largest is not None and shares[largest] < FAINT:
            lines.append(
                f"{name}: {largest.name}={values[largest.name]:g} is {shares[largest]:.0%} of its typical {largest.typical:g} {largest.unit}: "
                "hardly any recording shows an effect of this size"
            )
    return lines


def drawn(model: Model, count: int, rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """`count` effects chosen at random, each with a random size between SIZES, within its bounds. Raises NotHidden."""
    if count > len(model.effects):
        raise NotHidden(f"--random {count}: {model.name} has only {len(model.effects)} effects")
    found = {}
    # sorted: the sizes drawn below then do not depend on the order in which the effects were drawn
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
    """A manoeuvre as a recording: its inputs, and outputs with time stamps but placeholder values."""
    step = max(model.step_s, 1.0 / FASTEST_HZ)
    stamps = np.asarray(step * np.arange(int(manoeuvre.duration_s / step) + 1), float)
    # the placeholder is a ramp, because the channel checks reject a constant as a dead sensor
    empty = {name: Signal(stamps, stamps.copy(), unit) for name, unit in model.outputs.items()}
    return Recording(manoeuvre.name, {**empty, **manoeuvre.inputs}, constants)


def concealed(
    model: Model, basis: Recording, truth: Truth, initial: Mapping[str, float] | None = None
) -> Recording:
    """The basis with its outputs replaced by those of the truth, with noise and faults added.

    initial: initial states by name; states that are not given are guessed from the outputs of the basis. Raises NotHidden.
    """
    _check(model, truth)
    rng = np.random.default_rng(truth.seed)
    signals = dict(basis.signals)
    for name, signal in _simulated(model, basis, truth, initial or {}).items():
        # a constant output has no spread; its level then sets the scale, so that the noise is not zero
        spread = float(np.std(signal.value)) or float(np.mean(np.abs(signal.value)))
        sd = truth.noise.get(name, model.sensor_noise.get(name, DEFAULT_NOISE * spread))
        noisy = signal.value + _noise(rng, signal.value.size, sd, truth.memory)
        faults = [f for f in truth.faults if f.channel == name]
        _check_times(faults, signal)
        signals[name] = _faulty(replace(signal, value=noisy), faults, rng)
    return replace(basis, signals=signals)


def _check(model: Model, truth: Truth) -> None:
    """Raises NotHidden for an unknown baseline parameter or channel, or a value out of bounds."""
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
                f"noise of {name}: {sd:g} {model.outputs[name]} is not a standard deviation; it must be 0 or more"
            )


def _check_times(faults: Sequence[Fault], signal: Signal) -> None:
    """Raises NotHidden for a fault whose interval of time contains no sample."""
    for fault in [f for f in faults if f.kind in TIMED]:
        within = (signal.time_s >= fault.start_s) & (signal.time_s <= fault.end_s)
        if not within.any():
            raise NotHidden(
                f"{fault.channel}:{fault.kind}={fault.start_s:g}..{fault.end_s:g} s contains no sample; "
                f"the channel has samples from {signal.time_s[0]:g} to {signal.time_s[-1]:g} s"
            )


def _simulated(
    model: Model, basis: Recording, truth: Truth, initial: Mapping[str, float]
) -> dict[str, Signal]:
    """The outputs of the model with the truth's effects and parameters, without noise, at the stamps of the basis."""
    # One window over the whole recording: the truth is one continuous motion. The diagnosis may cut it into windows later.
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
    # A window also offers measured outputs, as a guess of initial states or an input of one-step predictors. Here those are
    # placeholders or another machine's outputs: they must not drive the simulation that replaces them.
    inputs = model.driving
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
    """First-order autoregressive noise of standard deviation `sd`; `memory` is its correlation at lag one."""
    # The innovations are smaller by sqrt(1 - memory²), so that the sum has the requested standard deviation. The filter
    # starts in its stationary state; from zero, the first samples would be too quiet.
    white = rng.normal(0.0, sd * np.sqrt(1.0 - memory**2), count)
    start = [memory * rng.normal(0.0, sd)]
    return np.asarray(lfilter([1.0], [1.0, -memory], white, zi=start)[0], float)


def _faulty(signal: Signal, faults: Sequence[Fault], rng: np.random.Generator) -> Signal:
    """The signal with all faults applied, one after the other."""
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
            # ten standard deviations: far outside of the motion itself, as a corrupted reading is
            value[hit] += rng.choice([-1.0, 1.0], np.count_nonzero(hit)) * 10.0 * np.std(value)
        elif fault.kind == "stuck":
            value[within] = value[within][0]
        elif fault.kind == "gap":
            kept = ~within
        signal = Signal(time_s[kept], value[kept], signal.unit, signal.held)
    return signal


def parsed_fault(model: Model, text: str) -> Fault:
    """The fault in a text such as 'level:lost=0.05' or 'level:stuck=10..12'. Raises NotHidden."""
    channel, _, rest = text.partition(":")
    kind, _, size = rest.partition("=")
    if channel not in model.outputs:
        raise NotHidden(
            f"--fault '{text}': {model.name} has no output '{channel}'; it has {', '.join(model.outputs)}"
        )
    if kind not in KINDS:
        raise NotHidden(f"--fault '{text}': unknown kind of fault '{kind}'; known are {', '.join(KINDS)}")
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
