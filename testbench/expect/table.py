"""Reads the [[expect]] tables of a scenario, or of a file of expectations, checked against the DBC and the plant's truth."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from configuration import CheckedTable, reader_of, tables_of
from dbc.database import Database
from testbench.expect.condition import Condition, value_of
from testbench.expect.detections import WITNESSES, Detected, Witness
from testbench.expect.expectations import (
    Expectation,
    InBounds,
    InStates,
    NoLiftOff,
    NoRollOver,
    Reached,
    Reaction,
    Response,
    Window,
)
from testbench.expect.obedience import LimitsObeyed
from testbench.expect.signals import AnySignal, SignalError, find_signal

# A day: a number beyond it is a time in another unit.
LONGEST_S = 86_400.0
Reader = Callable[[CheckedTable, Window, Database], Expectation]


def expectations_of(file: Path, database: Database, *, alone: bool = False) -> tuple[Expectation, ...]:
    """The expectations of a TOML file in its order; ConfigurationError names file, key, value, unit and range.

    alone: the file holds expectations and nothing else; otherwise it is a scenario and they may be missing.
    """
    return tables_of(
        file, "expect", lambda table: read_expectation(table, database), alone=alone, plural="expectations"
    )


def read_expectation(table: CheckedTable, database: Database) -> Expectation:
    """The expectation of one [[expect]] table. ConfigurationError if it is not valid."""
    read = reader_of(table, KINDS, "expectation", RENAMED)
    expectation = read(table, _window(table), database)
    table.finish()
    return expectation


def _window(table: CheckedTable) -> Window:
    from_s = table.number("from_s", unit="s", low=0.0, high=LONGEST_S, default=0.0)
    if "to_s" not in table:
        return Window(from_s)
    return Window(from_s, table.number("to_s", unit="s", low=from_s, high=LONGEST_S))


def _signal(table: CheckedTable, key: str, database: Database, default: str | None = None) -> AnySignal:
    try:
        return find_signal(table.text(key, default=default), database)
    except SignalError as error:
        raise table.error(key, f"= {error}") from None


def _condition(table: CheckedTable, key: str, database: Database) -> Condition:
    try:
        return Condition.parse(table.text(key), database)
    except SignalError as error:
        raise table.error(key, f"= {error}") from None


def _milliseconds(table: CheckedTable, key: str, default: float | None = None) -> float:
    return table.number(key, unit="ms", low=0.0, high=1e3 * LONGEST_S, default=default) * 1e-3


def _no_lift_off(_: CheckedTable, window: Window, __: Database) -> Expectation:
    return NoLiftOff(window)


def _no_roll_over(_: CheckedTable, window: Window, __: Database) -> Expectation:
    return NoRollOver(window)


def _signal_in_bounds(table: CheckedTable, window: Window, database: Database) -> Expectation:
    signal = _signal(table, "signal", database)
    if "minimum" not in table and "maximum" not in table:
        raise table.error("minimum", "and maximum are missing: give one of them, or both")
    unit = signal.unit or "1"
    low = table.number("minimum", unit=unit, default=-math.inf)
    high = table.number("maximum", unit=unit, default=math.inf)
    # such an expectation could never be met, and would look like a fault of the controller
    if low > high:
        raise table.error("minimum", f"= {low:g} is above maximum = {high:g}: exchanged?")
    return InBounds(signal, low, high, window, _milliseconds(table, "ignore_ms", 0.0))


def _state(table: CheckedTable, window: Window, database: Database) -> Expectation:
    signal = _signal(table, "signal", database, "EcuStatus.State")
    try:
        states = tuple(value_of(item, signal) for item in table.one_or_more("is"))
    except SignalError as error:
        raise table.error("is", f"= {error}") from None
    least = table.number("least_percent", unit="%", low=0.0, high=100.0, default=100.0)
    return InStates(signal, states, window, least / 100.0)


def _reached(table: CheckedTable, window: Window, database: Database) -> Expectation:
    return Reached(_condition(table, "condition", database), window, _milliseconds(table, "for_ms", 0.0))


def _response(table: CheckedTable, window: Window, database: Database) -> Expectation:
    cause, effect = _condition(table, "cause", database), _condition(table, "effect", database)
    return Response(cause, effect, _milliseconds(table, "within_ms"), window)


def _reaction(table: CheckedTable, _: Window, __: Database) -> Expectation:
    share = table.number("least_percent", unit="%", low=0.0, high=100.0, default=100.0)
    return Reaction(_milliseconds(table, "within_ms"), share / 100.0)


def _limits_obeyed(table: CheckedTable, window: Window, _: Database) -> Expectation:
    usual = LimitsObeyed()
    return LimitsObeyed(
        settle_s=table.number("settle_s", unit="s", low=0.0, high=60.0, default=usual.settle_s),
        speed_tolerance=table.number(
            "speed_tolerance_kmh", unit="km/h", low=0.0, high=50.0, default=usual.speed_tolerance * 3.6
        )
        / 3.6,
        rate_tolerance=math.radians(
            table.number(
                "rate_tolerance_deg_s",
                unit="deg/s",
                low=0.0,
                high=50.0,
                default=math.degrees(usual.rate_tolerance),
            )
        ),
        window=window,
    )


def _detected(table: CheckedTable, _: Window, database: Database) -> Expectation:
    # a number chooses by position, a text by the begin of the fault's description; absent: all faults
    fault = table.values.get("fault", "")
    chosen: int | str
    if isinstance(fault, int) and not isinstance(fault, bool):
        chosen = table.integer("fault", low=1, high=10_000)
    else:
        chosen = table.text("fault") if "fault" in table else ""
    by = table.text("by", default="ecu")
    witness: Witness | Condition
    if by in WITNESSES:
        witness = by
    else:
        try:
            witness = Condition.parse(by, database)
        except SignalError as error:
            raise table.error("by", f"is none of {', '.join(WITNESSES)}, and {error}") from None
    return Detected(chosen, witness, _milliseconds(table, "within_ms"))


KINDS: Mapping[str, Reader] = {
    "no_lift_off": _no_lift_off,
    "no_roll_over": _no_roll_over,
    "signal": _signal_in_bounds,
    "state": _state,
    "reached": _reached,
    "response": _response,
    "reaction": _reaction,
    "limits_obeyed": _limits_obeyed,
    "detected": _detected,
}
RENAMED: Mapping[str, str] = {"noticed": "detected"}
"""Old name of a kind -> its name; scenario files with the old name stay readable."""
