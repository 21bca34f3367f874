"""A run of a rig made ready for a fit: damage rejected with reasons, scale factor, slip (98), even samples, ramps and steps."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identify.rig.log import RigRun
from identify.signals.filters import averaged, filled, long_gaps, low_pass, spikes
from identify.signals.rejection import Rejection

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK_HZ = (
    100.0  # samples are averaged to this rate: far above the bandwidth of a tyre, with a fifth of the rows
)
LONGEST_GAP_S = 0.2  # over which speeds are interpolated
SETTLING_M = (
    1.0  # distance after a longer gap until the transient slip is known again: some relaxation lengths
)
SLOWEST = 0.1  # cylinder speed [m/s] below which no slip is defined
FREE_S = 1.0  # free rolling at the start of a run that a scale factor needs
DEPARTED = 5.0  # slip, in standard deviations, that ends the free rolling
BEYOND_FRICTION = 1.6  # force over load; no tyre reaches it on a dry cylinder


class Unusable(ValueError):
    """Nothing can be identified from a run; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """A run on an even grid, ready for a fit."""

    name: str
    kind: str
    step: float  # [s]
    time: Array  # (n,) [s]
    speed: Array  # of the cylinder (n,) [m/s]
    wheel: Array  # rolling speed of the wheel (n,) [m/s], by the run's own scale factor
    slip: Array  # (98) (n,)
    force: Array  # (n,) [N], NaN where rejected
    kept: Mask  # whether the force counts (n,)
    piston_pressure: float  # [Pa]
    inflation: float  # [Pa]
    scale: float  # K_scale [m], road per turn of the shaft
    scale_sd: float  # relative
    sliding_sd: Array  # of the difference of both speeds (n,) [m/s]
    force_sd: float  # of an averaged reading [N]
    rejected: Mapping[str, int]  # raw samples by reason
    warnings: tuple[str, ...] = ()


def prepared(run: RigRun, load: float) -> Trace:
    """The run of a rig as a trace. load: on the wheel [N], for what is physically possible. Raises Unusable."""
    step, block = _sampling(run)
    cleaned, kept, counts = {}, {}, dict[str, int]()
    for name in ("cylinder_speed", "shaft_speed", "force"):
        value = getattr(run, name)
        rejection = Rejection(value.size)
        rejection.reject(~np.isfinite(value), f"{name}: not recorded")
        rejection.reject(_stuck(value), f"{name}: stands still to the last digit")
        rejection.reject(spikes(value), f"{name}: spike")
        try:
            cleaned[name] = filled(value, rejection.kept)
        except ValueError as error:
            raise Unusable(f"{run.name}: {name}: {error}") from error
        kept[name] = rejection.kept
        counts |= rejection.counts
    longest = round(LONGEST_GAP_S / step)
    gap = long_gaps(kept["cylinder_speed"], longest) | long_gaps(kept["shaft_speed"], longest)
    speed, _ = averaged(cleaned["cylinder_speed"], np.ones(gap.size, bool), block)
    shaft, _ = averaged(cleaned["shaft_speed"], np.ones(gap.size, bool), block)
    force, count = averaged(cleaned["force"], kept["force"], block)
    time, _ = averaged(run.time, np.ones(gap.size, bool), block)
    scale, scale_sd, warnings = scale_factor(run.name, speed, shaft, block * step)
    wheel = scale * shaft
    rejection = Rejection(speed.size)
    rejection.reject(speed < SLOWEST, "cylinder stands")
    rejection.reject(
        _after(averaged(gap.astype(float), np.ones(gap.size, bool), block)[0] > 0, speed, block * step),
        "speeds missing too long",
    )
    rejection.reject(count < 1, "force missing")
    with np.errstate(invalid="ignore"):
        rejection.reject(np.abs(force) > BEYOND_FRICTION * load, "force beyond friction")
    if np.count_nonzero(rejection.kept) < 100:
        reasons = ", ".join(f"{r}: {n}" for r, n in rejection.counts.items())
        raise Unusable(
            f"{run.name}: only {np.count_nonzero(rejection.kept)} of {speed.size} averaged samples are left ({reasons})"
        )
    counts |= {
        reason: number * block for reason, number in rejection.counts.items() if reason != "force missing"
    }
    return Trace(
        name=run.name,
        kind=run.kind or kind_of(speed, wheel),
        step=block * step,
        time=time,
        speed=speed,
        wheel=wheel,
        slip=slip(speed, wheel),
        force=np.where(rejection.kept, force, np.nan),
        kept=rejection.kept,
        piston_pressure=run.piston_pressure,
        inflation=run.inflation,
        scale=scale,
        scale_sd=scale_sd,
        sliding_sd=_sliding_sd(run, kept, scale, block)[: speed.size],
        force_sd=noise_sd(run.force[kept["force"]]) / float(np.sqrt(block)),
        rejected=counts,
        warnings=warnings,
    )


def noise_sd(value: Array) -> float:
    """Standard deviation of white noise (n,) on a slow signal, by its second differences; 0 for fewer than three samples."""
    second = np.diff(value, 2)
    # second differences of white noise have the variance 1 + 4 + 1 = 6; the median is robust against steps of the signal
    return 1.4826 * float(np.median(np.abs(second))) / float(np.sqrt(6.0)) if second.size else 0.0


def _sliding_sd(run: RigRun, kept: Mapping[str, Mask], scale: float, block: int) -> Array:
    """Of averaged samples (n,): noise of both speeds; where samples were interpolated the error is one for all of the gap."""
    total = np.zeros(run.time.size // block)
    for name, factor in (("cylinder_speed", 1.0), ("shaft_speed", scale)):
        sd = factor * noise_sd(getattr(run, name)[kept[name]])
        _, count = averaged(np.ones(run.time.size), kept[name], block)
        total += sd**2 * np.where(count > 0, 1.0 / np.maximum(count, 1.0), 2.0)
    return np.sqrt(total)


def slip(speed: Array, wheel: Array) -> Array:
    """-(V_cyl - V_r)/V_cyl (98), NaN where the cylinder stands."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(np.abs(speed) > SLOWEST, -(speed - wheel) / speed, np.nan), float)


def _sampling(run: RigRun) -> tuple[float, int]:
    """Time step [s] and samples per block. Raises Unusable for stamps that are not even."""
    if run.time.size < 200:
        raise Unusable(f"{run.name}: has {run.time.size} samples; a run needs seconds of them")
    steps = np.diff(run.time)
    step = float(np.median(steps))
    if step <= 0.0 or np.any(steps <= 0.0):
        raise Unusable(
            f"{run.name}: stamps do not ascend (sample {int(np.argmin(steps)) + 1}): was the file sorted or joined?"
        )
    if np.max(np.abs(steps - step)) > 0.5 * step:
        raise Unusable(
            f"{run.name}: stamps are uneven ({step * 1e3:.3g} ms, once {float(np.max(steps)) * 1e3:.3g} ms): samples are missing; "
            "leave their rows in, with empty cells"
        )
    block = max(1, round(1.0 / step / BLOCK_HZ))
    return step, block


def _stuck(value: Array, longest: int = 50) -> Mask:
    """Samples within long runs of one and the same value: a dead channel. A constant that is true has noise."""
    same = np.concatenate(([False], value[1:] == value[:-1]))
    return long_gaps(~same, longest)


def _after(gap: Mask, speed: Array, step: float) -> Mask:
    """Gaps and the road behind them over which the transient slip is not known."""
    out, left = gap.copy(), 0.0
    for k in range(gap.size):
        left = SETTLING_M if gap[k] else left - abs(float(speed[k])) * step
        out[k] = gap[k] or left > 0.0
    return out


def scale_factor(name: str, speed: Array, shaft: Array, step: float) -> tuple[float, float, tuple[str, ...]]:
    """K_scale [m] with which the wheel rolls freely at the start, its relative standard deviation, and warnings.

    The free rolling ends where the ratio of the speeds departs from that of the first second. Raises Unusable if the wheel or the cylinder does not turn.
    """
    n = round(FREE_S / step)
    first_speed, first_shaft = speed[:n], shaft[:n]
    if float(np.median(first_speed)) < SLOWEST:
        raise Unusable(
            f"{name}: the cylinder stands at the start ({float(np.median(first_speed)):.3g} m/s): no scale factor without rolling"
        )
    if float(np.median(first_shaft)) <= 1e-3:
        raise Unusable(
            f"{name}: the shaft does not turn forwards at the start ({float(np.median(first_shaft)):.3g} rev/s): is its sign or its channel wrong?"
        )
    ratio = shaft / np.maximum(speed, SLOWEST)
    middle = float(np.median(ratio[:n]))
    spread = 1.4826 * float(np.median(np.abs(ratio[:n] - middle))) + 1e-9
    smooth = low_pass(ratio, 1.0 / step, 2.0, 2) if ratio.size > 60 else ratio
    away = np.abs(smooth[n:] - middle) > DEPARTED * spread / np.sqrt(5.0)
    end = n + (int(np.argmax(away)) if away.any() else away.size)
    free = slice(0, max(n, end - n // 4))
    mean = float(np.mean(shaft[free])) / float(np.mean(speed[free]))  # shaft speed per road speed
    halves = np.array_split(ratio[free], 8)
    sd = float(np.std([float(np.mean(h)) for h in halves])) / np.sqrt(8.0) / mean
    warnings: tuple[str, ...] = ()
    drift = float(np.mean(ratio[: n // 2]) / np.mean(ratio[n // 2 : n])) - 1.0
    if abs(drift) > 1e-3 + 8.0 * noise_sd(ratio[:n]) / mean * 2.0 / float(np.sqrt(n)):
        warnings = (
            f"{name}: slip changes by {drift:.3%} within the first second: does the run begin under load?",
        )
    return 1.0 / mean, max(sd, 2e-4), warnings


def kind_of(speed: Array, wheel: Array) -> str:
    """Which run of the protocol it is, from its signals: drive, brake, steps (of the cylinder), validation (steps of the wheel)."""
    if len(steps(speed)) >= 3:
        return "steps"
    s = slip(speed, wheel)
    low, high = np.nanquantile(s, [0.005, 0.995])
    if high < -low:
        return "brake"
    return "validation" if float(np.median(speed)) > 0.45 else "drive"


def steps(speed: Array, least: float = 0.1, settle: int = 100) -> list[int]:
    """Samples at which a speed leaves one level for another by more than `least` [m/s]; settle: samples of a level at least."""
    n = speed.size
    if n < 3 * settle:
        return []
    width = settle // 2
    total = np.concatenate(([0.0], np.cumsum(speed)))
    at = np.arange(width, n - width)
    jump = (total[at + width] - 2.0 * total[at] + total[at - width]) / width
    found: list[int] = []
    strength = np.abs(jump)
    while strength.size and float(np.max(strength)) > least:
        peak = int(np.argmax(strength))
        found.append(peak + width)
        strength[max(0, peak - settle) : peak + settle] = 0.0
    return sorted(found)


def ramps(time: Array, value: Array, kept: Mask, noise: float) -> list[tuple[float, float]]:
    """Times between which a slip rises or falls beyond its noise: the parts of a run that contain information on the slip curve."""
    away = kept & (np.abs(np.nan_to_num(value)) > 5.0 * noise)
    edges = np.diff(np.concatenate(([False], away, [False])).astype(np.int8))
    spans = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return [(float(time[a]), float(time[b - 1])) for a, b in spans if b - a > 20]


def slower(trace: Trace, by: int) -> Trace:
    """The trace with means of `by` samples; a mean counts where all of them do."""
    n = trace.speed.size // by * by

    def mean(x: Array) -> Array:
        return np.asarray(x[:n].reshape(-1, by).mean(axis=1), float)

    kept = np.asarray(np.all(trace.kept[:n].reshape(-1, by), axis=1), bool)
    return replace(
        trace,
        step=trace.step * by,
        time=mean(trace.time),
        speed=mean(trace.speed),
        wheel=mean(trace.wheel),
        slip=mean(trace.slip),
        force=np.where(kept, mean(np.where(trace.kept, trace.force, 0.0)), np.nan),
        kept=kept,
        sliding_sd=mean(trace.sliding_sd) / np.sqrt(by),
        force_sd=trace.force_sd / float(np.sqrt(by)),
    )
