"""Judges roll-over in a run: whether it happened, whether a warning came in time, whether it was prevented.

Pure: arrays in, a verdict out. Definitions:

- A wheel *lifts* when its true normal force is zero for longer than 50 ms; the moment is the first
  sample of zero. Shorter contact losses are wheel hop.
- The machine *rolls over* when its true roll angle passes 45 degrees; it does not come back from there.
- A *warning* is RollOver.State at "warning" or above, or Warnings.RollOverPredicted or RollOverNow.
  Frames whose state is "not_available" or whose estimate is marked invalid do not warn. It counts from its
  first frame, provided that it then stands for at least 50 ms; a shorter one is flicker, which no driver
  sees and which must not be taken for foresight.
- The *margin* is the smallest true normal force of any wheel over the whole run, as a fraction
  of what that wheel carries while the straight machine stands on level ground.
- A *false alarm* is a run that warns although no wheel lifts and the margin stays above 0.30.
  A warning at a smaller margin without lift-off counts as justified.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

WHEELS = ("front left", "front right", "rear left", "rear right")
SLACK_S = 1e-3  # [s]; the stamp of a frame shifts by the frames before it on the wire
LIFT_MIN_S = 0.050  # longer than the hop of a tyre at its own mode of about 3 Hz over a joint
WARNING_MIN_S = 0.050  # five frames in a row
ROLLED_RAD = np.pi / 4  # beyond the static tipping angle of the machine in every pose (34 degrees empty)
JUSTIFIED_MARGIN = 0.30
STATE_WARNING, STATE_NOT_AVAILABLE = 2, 7


class Result(Enum):
    """The answer of a check. One that cannot decide is INCONCLUSIVE; it never passes."""

    PASSED = "PASSED"
    FAILED = "FAILED"
    INCONCLUSIVE = "INCONCLUSIVE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One question with its answer and the reason for it."""

    question: str
    result: Result
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunVerdict:
    """Roll-over in one run. Times [s] on the truth's clock, None where the event did not happen."""

    lift_off_s: float | None  # first lift-off of a wheel
    lifting_wheel: int | None  # index of that wheel: FL, FR, RL, RR
    rolled_over_s: float | None
    warned_s: float | None  # first warning of the ECU
    margin: float  # smallest wheel load over the standing one, 0 at lift-off
    largest_roll: float  # absolute value [rad]
    largest_load_transfer: float  # absolute load transfer ratio

    @property
    def lifted(self) -> bool:
        """Whether a wheel lifted."""
        return self.lift_off_s is not None

    @property
    def rolled_over(self) -> bool:
        """Whether the machine went over."""
        return self.rolled_over_s is not None

    @property
    def lead_s(self) -> float | None:
        """Time from the first warning to lift-off [s]; negative when the warning was late, None without either."""
        if self.lift_off_s is None or self.warned_s is None:
            return None
        return self.lift_off_s - self.warned_s

    @property
    def warned_in_time(self) -> bool:
        """Whether a warning came strictly before lift-off."""
        return self.lead_s is not None and self.lead_s > 0

    @property
    def false_alarm(self) -> bool:
        """Whether the ECU warned although no wheel lifted and the margin stayed above JUSTIFIED_MARGIN."""
        return self.warned_s is not None and not self.lifted and self.margin > JUSTIFIED_MARGIN


def lift_offs(
    time_s: ArrayLike, normal_force: ArrayLike, least_s: float = LIFT_MIN_S
) -> list[tuple[float, float, int]]:
    """Every lift-off of more than `least_s` [s] in the order of their beginnings: its first and last moment [s], and its wheel.

    time_s: (n,) increasing; normal_force: (n, 4) [N]. A NaN is not contact.
    """
    time = np.asarray(time_s, float)
    # not "<= 0": a NaN then counts as lift-off, not as contact
    off = ~(np.asarray(normal_force, float) > 0)
    return sorted(
        (float(time[start]), float(time[stop]), wheel)
        for wheel in range(4)
        for start, stop in _intervals(off[:, wheel])
        if time[stop] - time[start] > least_s
    )


def first_lift_off(time_s: ArrayLike, normal_force: ArrayLike) -> tuple[float, int] | None:
    """Moment [s] and wheel of the first lift-off, or None; arguments as of `lift_offs`."""
    found = [(begin, wheel) for begin, _, wheel in lift_offs(time_s, normal_force)]
    return min(found, default=None)


def _intervals(condition: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every unbroken interval in which `condition` is true."""
    edges = np.diff(np.concatenate(([False], condition, [False])).astype(np.int8))
    return list(zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True))


def lasting(time_s: ArrayLike, condition: ArrayLike, least_s: float) -> list[float]:
    """Where `condition` begins to hold unbroken for at least `least_s` [s]: the times of the first samples."""
    time = np.asarray(time_s, float)
    intervals = _intervals(np.asarray(condition, bool))
    return [float(time[start]) for start, stop in intervals if time[stop] - time[start] >= least_s - SLACK_S]


def flickers(time_s: ArrayLike, condition: ArrayLike, least_s: float) -> int:
    """How often `condition` holds for less than `least_s` [s]; one that the record's end cuts off does not count."""
    holds = np.asarray(condition, bool)
    ended = [interval for interval in _intervals(holds) if interval[1] < holds.size - 1]
    time = np.asarray(time_s, float)
    return sum(bool(time[stop] - time[start] < least_s - SLACK_S) for start, stop in ended)


def first_true(time_s: ArrayLike, condition: ArrayLike) -> float | None:
    """Time of the first sample at which `condition` holds, or None."""
    index = np.flatnonzero(np.asarray(condition, bool))
    return float(np.asarray(time_s, float)[index[0]]) if index.size else None


def roll_over_warning(state: ArrayLike, valid: ArrayLike) -> NDArray[np.bool_]:
    """Where RollOver frames warn: severity warning, imminent or lifted, from a valid estimate."""
    state, valid = np.asarray(state), np.asarray(valid, bool)
    return valid & (state >= STATE_WARNING) & (state < STATE_NOT_AVAILABLE)


def judge(
    *,
    time_s: ArrayLike,
    normal_force: ArrayLike,
    roll: ArrayLike,
    load_transfer_ratio: ArrayLike,
    warned_s: float | None,
    standing: ArrayLike,
) -> RunVerdict:
    """The verdict of one run from the plant's truth and the time of the first warning.

    time_s, roll [rad], load_transfer_ratio: (n,); normal_force: (n, 4) [N]; standing: (4,), the loads of the straight machine
    at rest on level ground [N]. A run that starts on a bank or in a turn begins with other loads.
    """
    time, force = np.asarray(time_s, float), np.asarray(normal_force, float)
    if time.size == 0:
        raise ValueError(
            "no truth to judge: the run has no sample; was the plant killed before it wrote any?"
        )
    if not np.all(force[0] > 0):
        raise ValueError(
            f"the run starts with normal forces {force[0]} N; every wheel has to stand on the ground"
        )
    level = np.asarray(standing, float)
    if not np.all(level > 0):
        raise ValueError(f"standing loads {level} N: every wheel has to carry some on level ground")
    lift = first_lift_off(time, force)
    return RunVerdict(
        lift_off_s=lift[0] if lift else None,
        lifting_wheel=lift[1] if lift else None,
        rolled_over_s=first_true(time, np.abs(np.asarray(roll, float)) > ROLLED_RAD),
        warned_s=warned_s,
        margin=float(np.min(force / level)),
        largest_roll=float(np.max(np.abs(np.asarray(roll, float)))),
        largest_load_transfer=float(np.max(np.abs(np.asarray(load_transfer_ratio, float)))),
    )


def judge_warning(run: RunVerdict) -> Verdict:
    """Was lift-off announced before it came?"""
    question = "the warning came before lift-off"
    if run.lift_off_s is None:
        return Verdict(question=question, result=Result.INCONCLUSIVE, reason="no wheel lifted")
    if run.warned_s is None:
        return Verdict(
            question=question,
            result=Result.FAILED,
            reason=f"lift-off at {run.lift_off_s:.2f} s, never a warning",
        )
    lead = run.lift_off_s - run.warned_s
    return Verdict(
        question=question,
        result=Result.PASSED if lead > 0 else Result.FAILED,
        reason=f"{abs(lead):.2f} s {'before' if lead > 0 else 'after'} lift-off at {run.lift_off_s:.2f} s",
    )


def judge_prevention(without: RunVerdict, limited: RunVerdict) -> Verdict:
    """Do the ECU's limits prevent what happens without them?"""
    question = "the limits prevent the roll-over"
    if not without.lifted:
        return Verdict(
            question=question,
            result=Result.INCONCLUSIVE,
            reason="without the limits no wheel lifts: nothing to prevent",
        )
    if limited.rolled_over or limited.lift_off_s is not None:
        what = "rolls over" if limited.rolled_over else f"lifts a wheel at {limited.lift_off_s:.2f} s"
        return Verdict(
            question=question, result=Result.FAILED, reason=f"with the limits on the machine {what}"
        )
    return Verdict(
        question=question,
        result=Result.PASSED,
        reason=f"every wheel keeps at least {100 * limited.margin:.0f} % of its standing load",
    )
