"""The chain from motion capture and a wheel transducer to points of slip and force, with counts of rejected samples by reason."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from identify.field.frames import SLOWEST, effective_radius, ground_height, rotated, slip
from identify.field.log import FieldLog, Somat, Vicon
from identify.signals.clock_sync import Sync, Unsynchronised, first_pulse, synchronised
from identify.signals.filters import filled, low_pass, spikes, unwrapped
from identify.signals.kalman import Motion, motion
from identify.signals.rejection import Rejection, added

Array = NDArray[np.float64]

SHORTEST_EVENT = 200  # readings inside the scope of the cameras: one second
START_UP_S = 0.3  # at both ends of an event, where the smoother has data on one side only
WINDOW_S = 0.4  # whose means make one point
SETTLED = 0.1  # permitted change of a slip within a window: this share of it plus the next
SETTLED_SLIP, SETTLED_ANGLE = 0.003, 0.01  # the angle's as its tangent
SETTLING_M = 1.2  # distance after a change of slip; the fit models what a soft carcass leaves of the lag then
ENTRY_M = 0.5  # distance at the start of an event, where the smoother still settles
BEYOND_FRICTION = 1.6  # force over load; no tyre reaches it
LIGHTEST = 2e3  # load [N] below which the wheel is taken to have no contact
RATE_HZ = 200.0  # of the common time base
ASPHALT_GROUPS = ((19e3, 29e3), (29e3, 39e3), (39e3, 49e3), (59e3, 69e3), (79e3, 89e3))
"""(114), loads on the hub [N]."""
GRAVEL_GROUPS = ((19e3, 29e3), (29e3, 39e3), (39e3, 49e3), (49e3, 59e3), (59e3, 69e3))
"""(115)."""


class Unusable(ValueError):
    """Nothing can be identified from a field log; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Means over windows (n,): one is one data set of (113)."""

    event: NDArray[np.intp]
    first: NDArray[np.intp]  # sample of the event at which the window begins
    slip_markers: Array  # kappa1 (110)
    slip: Array  # kappa2 (111), of the markers where the encoder is not synchronised
    slip_sd: Array
    force: Array  # less the tare [N]
    force_sd: Array
    load: Array  # on the road: hub and wheel [N]
    speed: Array
    side_slip: Array  # tangent of the slip angle


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One passage through the scope on an even time base."""

    number: int
    time: Array
    speed: Array
    slip_markers: Array
    slip: Array
    force: Array
    load: Array
    kept: NDArray[np.bool_]

    def bridged(self) -> tuple[Array, Array]:
        """Slip and speed along the wheel (n,), straight lines over what was rejected, so that it does not act on what follows."""
        usable = self.kept & np.isfinite(self.slip)
        slip, speed = (
            np.interp(self.time, self.time[usable], value[usable]) for value in (self.slip, self.speed[0])
        )
        first = int(np.argmax(usable))
        travelled = np.cumsum(np.abs(speed[first:])) / RATE_HZ
        entered = first + int(np.searchsorted(travelled, ENTRY_M, side="right"))
        slip[:entered] = np.median(slip[first : entered + 1])
        return slip, speed


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldResult:
    """All events, their points, the clock, and what was rejected."""

    log: FieldLog
    events: Sequence[Event]
    points: Points
    sync: Sync
    tare: float
    rejected: Mapping[str, int]
    warnings: Sequence[str]
    oscillation_hz: float  # strongest frequency of the encoder's speed above 8 Hz


def processed(log: FieldLog) -> FieldResult:
    """The whole chain. Raises Unusable."""
    spans, counts = events_of(log.vicon)
    if not spans:
        raise Unusable(
            f"{log.name}: the wheel is never inside the scope (Y is 0 throughout): is it another marker, or another file?"
        )
    angle, wheel, oscillation = _encoder(log.somat)
    markers = [_marker_angle(log.vicon, s) for s in spans]
    pulse = first_pulse(log.vicon.time, log.vicon.sync)
    warnings = (
        []
        if pulse is not None
        else ["the sync vector has no pulse: the clocks are synchronised by their content alone"]
    )
    try:
        sync = synchronised([m[:2] for m in markers], log.somat.time, angle, wheel, pulse)
    except Unsynchronised as error:
        raise Unusable(f"{log.name}: {error}") from error
    if pulse is not None and abs(sync.offset - pulse) > 0.1:
        warnings.append(
            f"pulse and content differ by {sync.offset - pulse:+.3f} s: either the positions are delayed by this time, or the pulse is another one"
        )
    tare, tare_warning = _tare(log)
    warnings += tare_warning
    events, points = [], []
    for number, span in enumerate(spans):
        event, reasons = _event(log, span, number, sync, wheel, tare)
        counts = added(counts, reasons)
        events.append(event)
        if number in sync.lost:
            warnings.append(
                f"event {number + 1} lies {sync.event_offset[number]:+.3f} s beside the common clock: its force belongs to another slip; rejected"
            )
            continue
        found, few = _points(event)
        counts = added(counts, few)
        points += [(number, *row) for row in found]
    if len(points) < 4:
        reasons_text = ", ".join(f"{r}: {n}" for r, n in counts.items())
        raise Unusable(f"{log.name}: only {len(points)} points of settled slip are left ({reasons_text})")
    columns = np.array(points, float)
    return FieldResult(
        log=log, events=events, points=Points(
            event=columns[:, 0].astype(np.intp), first=columns[:, 1].astype(np.intp), **{n: columns[:, i] for i, n in enumerate(_COLUMNS, 2)}
        ), sync=sync,
        tare=tare, rejected=counts, warnings=warnings, oscillation_hz=oscillation,
    )  # fmt: skip


_COLUMNS = ("slip_markers", "slip", "slip_sd", "force", "force_sd", "load", "speed", "side_slip")


def events_of(vicon: Vicon) -> tuple[list[slice], dict[str, int]]:
    """Intervals of readings inside the scope, and counts of those outside; a gap of up to five readings does not end an event."""
    inside = ~(vicon.y == 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(np.int8)))
    spans: list[slice] = []
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if spans and a - spans[-1].stop <= 5:
            spans[-1] = slice(spans[-1].start, b)
        else:
            spans.append(slice(a, b))
    long = [s for s in spans if s.stop - s.start >= SHORTEST_EVENT]
    short = sum(s.stop - s.start for s in spans) - sum(s.stop - s.start for s in long)
    return long, {
        k: v
        for k, v in {"outside the scope": int(np.count_nonzero(~inside)), "event too short": short}.items()
        if v
    }


def time_base(time: Array, *values: Array) -> tuple[Array, list[Array], int]:
    """Ascending stamps without repetitions, the values there, and how many readings were repetitions."""
    unique, index = np.unique(time, return_index=True)
    return unique, [v[index] for v in values], int(time.size - unique.size)


def _encoder(somat: Somat) -> tuple[Array, Array, float]:
    """Unwrapped angle, turning speed [rad/s] by the same zero-phase filter as all, and the strongest oscillation [Hz]."""
    step = float(np.median(np.diff(somat.time)))
    if step <= 0.0 or np.any(np.diff(somat.time) <= 0.0):
        raise Unusable("the stamps of the transducer do not ascend: was its file sorted or joined?")
    angle = (
        unwrapped(filled(somat.angle, np.isfinite(somat.angle)))
        if np.isnan(somat.angle).any()
        else unwrapped(somat.angle)
    )
    if np.ptp(angle) < 1.0:
        raise Unusable(
            f"the encoder turns by {float(np.ptp(angle)):.2f} rad in all: is it dead, or is its unit turns?"
        )
    turning = np.gradient(angle, step)
    spectrum = (
        np.abs(np.fft.rfft(somat.fx - uniform_filter1d(somat.fx, 251)))
        if np.isfinite(somat.fx).all()
        else np.zeros(somat.time.size // 2 + 1)
    )
    frequency = np.fft.rfftfreq(somat.time.size, step)[: spectrum.size]
    band = (frequency > 8.0) & (frequency < 60.0)
    return (
        angle,
        low_pass(turning, 1.0 / step),
        float(frequency[band][np.argmax(spectrum[: frequency.size][band])]) if band.any() else float("nan"),
    )


def _marker_angle(vicon: Vicon, span: slice) -> tuple[Array, Array, int]:
    time, (pitch,), repeated = time_base(vicon.time[span], vicon.pitch[span])
    known = np.isfinite(pitch)
    angle = np.unwrap(pitch[known])
    clean = ~spikes(angle - uniform_filter1d(angle, 15, mode="nearest"))
    return time[known][clean], angle[clean], repeated


def _tare(log: FieldLog) -> tuple[float, list[str]]:
    """Zero of the longitudinal force: its mean while the machine stands."""
    still = log.somat.time < log.standing_s
    force = log.somat.fx[still]
    force = force[np.isfinite(force) & ~spikes(force)]
    if force.size < 100:
        return 0.0, ["the transducer's log has no standing start: its zero is taken as it is"]
    angle = unwrapped(log.somat.angle[still])
    moved = (
        []
        if np.nanmax(np.abs(angle - angle[0])) < 0.05
        else ["the wheel turns in the standing start: its zero is doubtful"]
    )
    return float(np.mean(force)), moved


def _event(
    log: FieldLog, span: slice, number: int, sync: Sync, turning: Array, tare: float
) -> tuple[Event, dict[str, int]]:
    v, s = log.vicon, log.somat
    stamps, (x, y, z, pitch, yaw), repeated = time_base(
        v.time[span], v.x[span], v.y[span], v.z[span], v.pitch[span], v.yaw[span]
    )
    smooth: list[Motion] = [motion(stamps, value) for value in (x, y)]
    known = np.isfinite(pitch)
    rolled = np.full(pitch.size, np.nan)
    rolled[known] = np.unwrap(pitch[known])
    wheel = motion(stamps, rolled)
    heading, height = (
        motion(stamps, value).position
        for value in (unwrapped(yaw), z - ground_height(log.ground, smooth[0].position, smooth[1].position))
    )
    time = np.arange(stamps[0], stamps[-1], 1.0 / RATE_HZ)

    def even(value: Array) -> Array:
        return np.interp(time, stamps, value)

    along, across = rotated(even(smooth[0].velocity), even(smooth[1].velocity), even(heading))
    radius = effective_radius(np.minimum(even(height), log.nominal.radius), log.nominal.radius)
    clock = (time - sync.offset) / (1.0 + sync.drift)
    force, load = (
        np.interp(
            clock,
            s.time,
            low_pass(filled(f, np.isfinite(f) & ~spikes(f)), 1.0 / float(np.median(np.diff(s.time)))),
        )
        for f in (s.fx, s.fz)
    )
    rejection = Rejection(time.size)
    rejection.reject(
        (time < time[0] + START_UP_S) | (time > time[-1] - START_UP_S), "start-up of the smoother"
    )
    rejection.reject((clock < s.time[0]) | (clock > s.time[-1]), "transducer not recorded")
    gap = (
        np.interp(
            time, stamps, (smooth[0].velocity_sd > 4.0 * np.median(smooth[0].velocity_sd)).astype(float)
        )
        > 0.5
    )
    rejection.reject(gap, "markers hidden too long")
    rejection.reject(np.abs(along) < SLOWEST, "speed too low for a slip")
    rejection.reject(load + log.wheel_weight < LIGHTEST, "wheel without contact")
    rejection.reject(
        np.abs(force - tare) > BEYOND_FRICTION * (load + log.wheel_weight), "force beyond friction"
    )
    if number in sync.lost:
        rejection.reject(np.ones(time.size, bool), "event not synchronised")
    by_markers = slip(along, even(wheel.velocity), radius)
    counts = dict(rejection.counts)
    if repeated:
        counts["repeated stamp"] = repeated
    jumps = int(
        np.count_nonzero(smooth[0].rejected)
        + np.count_nonzero(smooth[1].rejected)
        + np.count_nonzero(wheel.rejected)
    )
    if jumps:
        counts["marker jumps"] = jumps
    event = Event(
        number=number,
        time=time,
        speed=np.stack([along, across]),
        slip_markers=by_markers,
        slip=slip(along, np.interp(clock, s.time, turning), radius),
        force=force - tare,
        load=load + log.wheel_weight,
        kept=rejection.kept,
    )
    return event, counts


def _points(event: Event) -> tuple[list[tuple[float, ...]], dict[str, int]]:
    """Windows in which slip has settled: first sample, then means in the order of _COLUMNS; and counts of the samples that were left out."""
    n = round(WINDOW_S * RATE_HZ)
    out: list[tuple[float, ...]] = []
    counts = {"slip not settled": 0, "slip angle not settled": 0}
    side = -event.speed[1] / np.maximum(np.abs(event.speed[0]), SLOWEST)
    smooth, angle = (uniform_filter1d(np.nan_to_num(v), 41) for v in (event.slip, side))
    for a in range(0, event.time.size - n + 1, n):
        part = slice(a, a + n)
        if not event.kept[part].all():
            continue
        speed = float(np.mean(event.speed[0, part]))
        before = max(0, a - round(SETTLING_M / max(abs(speed), SLOWEST) * RATE_HZ))
        unsettled = [
            name
            for name, value, least in (
                ("slip not settled", smooth, SETTLED_SLIP),
                ("slip angle not settled", angle, SETTLED_ANGLE),
            )
            if np.ptp(value[before : a + n]) > SETTLED * abs(float(np.mean(value[part]))) + least
        ]
        if unsettled:
            counts[unsettled[0]] += n
            continue
        force = event.force[part]
        # after a filter of 5 Hz a window of 0.4 s has about four independent values, so a mean has half the standard deviation
        spread = float(np.std(force)) / 2.0
        difference = event.slip[part] - event.slip_markers[part]
        out.append((
            a, float(np.mean(event.slip_markers[part])), float(np.mean(event.slip[part])), max(float(np.std(difference)) / 2.0, 3e-4), float(np.mean(force)),
            max(spread, 30.0), float(np.mean(event.load[part])), speed, float(-np.mean(event.speed[1, part]) / abs(speed)),
        ))  # fmt: skip
    return out, {k: v for k, v in counts.items() if v}


def load_groups(
    points: Points, groups: Sequence[tuple[float, float]], wheel_weight: float
) -> list[tuple[float, NDArray[np.bool_]]]:
    """Mean load on the road of each group (114), (115) that has points, and which they are; bounds are loads on the hub."""
    hub = points.load - wheel_weight
    found = [(hub >= low) & (hub < high) for low, high in groups]
    return [(float(np.mean(points.load[mask])), mask) for mask in found if mask.any()]
