"""Alarms: conditions that must last to be raised, and must stay away to be dropped.

What a driver sees may neither flicker nor come late. An alarm is raised when its condition has held
without a break for the on-delay; it then stands for its least time, and until the condition has been
gone for the off-delay. Pure: the time is that of the cycle, and a repeated cycle changes nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Delays of an alarm [ns]."""

    on_delay_ns: int
    least_on_ns: int
    off_delay_ns: int


@dataclass(frozen=True, slots=True)
class Alarm:
    """One alarm between two cycles; times on the cycle's clock [ns]."""

    on: bool = False
    raised_ns: int = 0
    against_ns: int | None = None
    """Since when the condition has contradicted `on`; None while it agrees."""


SILENT = Alarm()


def after(alarm: Alarm, condition: bool, now_ns: int, times: Times) -> Alarm:
    """The alarm after a cycle at `now_ns` in which `condition` was seen."""
    if condition == alarm.on:
        return alarm if alarm.against_ns is None else Alarm(alarm.on, alarm.raised_ns)
    since_ns = now_ns if alarm.against_ns is None else alarm.against_ns
    if not alarm.on:
        raised = now_ns - since_ns >= times.on_delay_ns
        return Alarm(True, now_ns) if raised else Alarm(False, alarm.raised_ns, since_ns)
    stood = now_ns - alarm.raised_ns >= times.least_on_ns
    gone = now_ns - since_ns >= times.off_delay_ns
    return Alarm(False, alarm.raised_ns) if stood and gone else Alarm(True, alarm.raised_ns, since_ns)


def advanced(
    alarms: Mapping[str, Alarm], conditions: Mapping[str, bool], now_ns: int, times: Mapping[str, Times]
) -> dict[str, Alarm]:
    """Every alarm of `conditions` after a cycle; one not known before starts silent."""
    return {
        # An alarm that agrees with its condition, as nearly all do, stays the same object.
        name: alarm
        if (alarm := alarms.get(name, SILENT)).on == condition and alarm.against_ns is None
        else after(alarm, condition, now_ns, times[name])
        for name, condition in conditions.items()
    }


def below(value: float, threshold: float, hysteresis: float, on: bool) -> bool:
    """Whether `value` is below a threshold, which lies higher by `hysteresis` once the alarm is on."""
    return value < (threshold + hysteresis if on else threshold)
