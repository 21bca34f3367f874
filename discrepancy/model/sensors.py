"""Sensor faults for any output of any model. Without them, a delayed gyro would be named as missing dynamics.

The faults act in this order: misalignment (turns two axes), lag, delay, scale and sign, bias and drift. They act on simulated, noise-free
outputs on the model's grid, so delays need not be multiples of the sample time.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import lfilter

from discrepancy.model.description import Effect, Parameter
from discrepancy.signals.recording import Array, Signal
from discrepancy.signals.units import parse_unit

KINDS = ("bias", "scale", "delay", "lag", "sign", "drift")
LINEAR = ("bias", "scale", "sign", "drift")  # linear in their size, so one trial step is enough
LAGS_KEPT = (
    5.0  # time constants before a window from which a lag starts: less than 1 % of what was before is left
)
LONGEST_DELAY_S = 0.5  # of a sensor; a larger shift is another clock (checks.clocks)
SLOWEST_LAG_S = 2.0


REVERSE = {
    "bias": "{} reads too little by a constant",
    "scale": "{} reads too little in proportion",
    "delay": "{} comes early by a constant time (stamps of another clock)",
}
"""Sentences for negative sizes."""


def sensor_effects(
    output: str, unit: str, *, bias: float, kinds: Iterable[str] = KINDS, delay_s: float = 0.05
) -> tuple[Effect, ...]:
    """Effects for the faults of one output channel. bias: an offset that matters [unit], also as a drift over a recording; delay_s: a delay that matters [s].

    Bounds: 20 biases either way, as a drift over the longest recording too; scale 0.3; delay 0.5 s or five times delay_s either way, lag 2 s or ten times delay_s.
    """
    library = _faults(output, unit, bias, delay_s)
    if unknown := set(kinds) - set(library):
        raise ValueError(
            f"sensor effects of {output}: unknown kinds {sorted(unknown)}; known are {', '.join(KINDS)}"
        )
    return tuple(
        Effect(
            name=f"{output} {kind}",
            sentence=sentence,
            equation=equation,
            parameters=(p,),
            kind="sensor",
            place=f"sensor of {output}",
            reading=output,
            reverse=REVERSE.get(kind, "").format(output),
            excited_by=excited,
            confusable=_confusable(output, kind),
        )
        for kind, (sentence, equation, p, excited) in library.items()
        if kind in kinds
    )


def device_delay(device: str, outputs: Iterable[str], *, delay_s: float = 0.05) -> Effect:
    """The effect of a device whose readings are all late by the same time: a tracker, a camera, a logger. delay_s: a delay that matters [s]."""
    readings = tuple(outputs)
    (delay,) = sensor_effects(device, "1", bias=1.0, kinds=("delay",), delay_s=delay_s)
    return replace(
        delay,
        place=f"clock of {device}: {', '.join(readings)}",
        reading="",
        readings=readings,
        confusable={f"{name} delay": f"fast changes of everything that {device} reads" for name in readings},
    )


def _faults(
    output: str, unit: str, bias: float, delay_s: float
) -> Mapping[str, tuple[str, str, Parameter, str]]:
    """By kind: sentence, equation, parameter, and what a recording must contain to show it."""

    def parameter(
        kind: str,
        of: str,
        value_range: tuple[float, float],
        size: float,
        *trial_steps: float,
        discrete: bool = False,
        over_recording: float | None = None,
    ) -> Parameter:
        low, high = value_range
        small = kind not in LINEAR
        return Parameter(
            name=f"{output}.{kind}",
            unit=of,
            lower=low,
            upper=high,
            typical=size,
            trial_steps=trial_steps,
            small=small,
            discrete=discrete,
            over_recording=over_recording,
        )

    # trial steps reach to four times delay_s and have to lie within the bounds, also where a slow sensor has delays of seconds
    longest, slowest = max(LONGEST_DELAY_S, 5.0 * delay_s), max(SLOWEST_LAG_S, 10.0 * delay_s)
    return {
        "bias": (
            f"{output} reads too much by a constant",
            "y = y_true + b",
            parameter("bias", unit, (-20 * bias, 20 * bias), bias),
            "standstill",
        ),
        "scale": (
            f"{output} reads too much in proportion",
            "y = (1 + s) y_true",
            parameter("scale", "1", (-0.3, 0.3), 0.03),
            "a wide range of the quantity",
        ),
        "delay": (
            f"{output} comes late by a constant time (transport, processing, clock)",
            "y(t) = y_true(t - T)",
            parameter("delay", "s", (-longest, longest), delay_s, delay_s, 4 * delay_s, -delay_s),
            "fast changes",
        ),
        "lag": (
            f"{output} is low-pass filtered",
            "tau dy/dt + y = y_true",
            parameter("lag", "s", (0.0, slowest), delay_s, delay_s, 4 * delay_s),
            "changes at several speeds",
        ),
        "sign": (
            f"{output} has the wrong sign",
            "y = (1 - 2 f) y_true, f = 1",
            parameter("sign", "1", (0.0, 1.05), 1.0, discrete=True),
            "any change",
        ),
        "drift": (
            f"{output} drifts in proportion to time",
            "y = y_true + d (t - t0)",
            parameter(
                "drift",
                str(parse_unit(unit) / parse_unit("s")),
                (-bias, bias),
                bias / 60.0,
                over_recording=bias,
            ),
            "a long recording",
        ),
    }


def _confusable(output: str, kind: str) -> Mapping[str, str]:
    if kind in ("delay", "lag"):
        other = "lag" if kind == "delay" else "delay"
        return {f"{output} {other}": "a step or fast sweep: a lag rounds it, a delay shifts it unchanged"}
    if kind == "bias":
        return {f"{output} drift": "a longer recording, standstill at both ends"}
    return {}


def misalignment(first: str, second: str) -> Effect:
    """The sensor's two axes are turned by an angle about the third [rad]."""
    return Effect(
        name=f"{first}/{second} misalignment",
        sentence=f"the axes of {first} and {second} are turned",
        equation="y1 = c x1 + s x2, y2 = c x2 - s x1",
        parameters=(
            Parameter(name=f"{first}.turn.{second}", unit="rad", lower=-0.5, upper=0.5, typical=0.03),
        ),
        kind="sensor",
        place=f"mounting of the sensor of {first} and {second}",
        excited_by="one axis excited while the other is not",
    )


def lagged(values: Array, time_constant_s: float, step_s: float) -> Array:
    """First-order lag (n,), exact for inputs that are linear between grid points; starts in its steady state."""
    if time_constant_s < 1e-9:
        return values
    a = np.exp(-step_s / time_constant_s)
    gain = (1.0 - a) * time_constant_s / step_s
    # y+ = a y + (gain - a) u + (1 - gain) u+
    b = np.array([1.0 - gain, gain - a])
    start = np.array([values[0] * (1.0 - b[0])])
    return np.asarray(lfilter(b, np.array([1.0, -a]), values, zi=start)[0], float)


def lagged_more(values: Array, more_s: float, before_s: float, step_s: float) -> Array:
    """Readings of a sampled sensor of time constant `before_s`, changed to those with `before_s + more_s`; starts in its steady state."""
    # A slower sensor is one low-pass with a longer time constant; two low-passes in series would be another sensor. The filter therefore
    # cancels the old pole and puts in the new one. Exact for held samples, as in plant.unit.sensors.
    if more_s < 1e-9:
        return values
    before, after = np.exp(-step_s / before_s), np.exp(-step_s / (before_s + more_s))
    gain = (1.0 - after) / (1.0 - before)
    b = np.array([gain, -before * gain])
    start = np.array([values[0] * (1.0 - gain)])
    return np.asarray(lfilter(b, np.array([1.0, -after]), values, zi=start)[0], float)


def delayed(values: Array, delay_s: float, time_s: Array) -> Array:
    """The signal (n,) delayed by T, y(t - T): linear between grid points, constant beyond the ends."""
    return values if delay_s == 0.0 else np.interp(time_s - delay_s, time_s, values)


Shown = Mapping[str, tuple[Array, Array]]
"""By output: the stamps of a recording's readings, and the readings without their fast noise."""
NEIGHBOURS = 7  # readings of which the middle one counts, so that neither noise nor a wrong reading does


def shown(signals: Mapping[str, Signal], outputs: Iterable[str]) -> Shown:
    """How the outputs of a recording move, as far as their sensors show it."""
    there = {name: signals[name] for name in outputs if name in signals}
    return {
        name: (s.time_s, np.asarray(median_filter(s.value, NEIGHBOURS, mode="nearest"), float))
        for name, s in there.items()
    }


def _as_shown(readings: tuple[Array, Array] | None, edge: float, at_s: float, time_s: Array) -> Array:
    """An output beside a window (n,): it moves as the readings do, and is `edge` at the time `at_s`, where the window begins or ends."""
    if readings is None:
        return np.full(time_s.size, edge)
    return np.asarray(np.interp(time_s, *readings) - np.interp(at_s, *readings) + edge, float)


def gain(name: str, values: Mapping[str, float]) -> float:
    """By what a sensor multiplies: its scale and sign."""
    return (1.0 + values.get(f"{name}.scale", 0.0)) * (1.0 - 2.0 * values.get(f"{name}.sign", 0.0))


def _late(
    name: str,
    true: Array,
    values: Mapping[str, float],
    time_s: Array,
    step_s: float,
    own_lag_s: float,
    readings: tuple[Array, Array] | None,
) -> Array:
    """An output (n,) behind lag and delay of its sensor; own_lag_s: the lag that it contains already [s]; readings: of it."""
    lag, delay = values.get(f"{name}.lag", 0.0), values.get(f"{name}.delay", 0.0)
    if lag == delay == 0.0:
        return true
    memory = LAGS_KEPT * (lag + own_lag_s) if lag > 0.0 else 0.0
    before, behind = (int(np.ceil(max(d, 0.0) / step_s)) for d in (delay + memory, -delay))
    there = time_s[0] + step_s * np.arange(-before, true.size + behind)
    first = _as_shown(readings, true[0], time_s[0], there[:before])
    last = _as_shown(readings, true[-1], time_s[-1], there[before + true.size :])
    y = np.concatenate([first, true, last])
    y = lagged_more(y, lag, own_lag_s, step_s) if own_lag_s else lagged(y, lag, step_s)
    return delayed(y, delay, there)[before : before + true.size]


def through_sensors(
    outputs: Mapping[str, Array],
    values: Mapping[str, float],
    time_s: Array,
    step_s: float,
    since_s: float,
    lags: Mapping[str, float],
    readings: Shown = MappingProxyType({}),
) -> dict[str, Array]:
    """Readings of the sensors by output; since_s: time at which a drift starts; lags: time constants that the outputs contain already [s].

    readings: what the sensors showed before the grid and behind it. A late, slow or early reading of this grid is of then. Where there are none, the
    output is constant there: the machine's own motion there would have to be simulated, from a state that nobody knows.
    """
    seen = dict(outputs)
    for name, angle in values.items():
        if ".turn." in name and angle != 0.0:
            one, _, two = name.partition(".turn.")
            if one in seen and two in seen:
                c, s = np.cos(angle), np.sin(angle)
                seen[one], seen[two] = c * seen[one] + s * seen[two], c * seen[two] - s * seen[one]
    # this runs for every simulation: skip the sensors without a fault, which are nearly all
    faulty = {name.rpartition(".")[0] for name, value in values.items() if value != 0.0}
    for name, true in seen.items():
        if name not in faulty:
            continue
        y = _late(name, true, values, time_s, step_s, lags.get(name, 0.0), readings.get(name))
        y = y * gain(name, values)
        seen[name] = (
            y + values.get(f"{name}.bias", 0.0) + values.get(f"{name}.drift", 0.0) * (time_s - since_s)
        )
    return seen
