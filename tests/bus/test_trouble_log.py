"""Findings of a bus in the log: news at once, a storm as one line a second."""

import pytest

from bus.errors import BusFinding, Fault
from bus.trouble_log import TroubleLog

S = 1_000_000_000


def lines(caplog: pytest.LogCaptureFixture, findings: list[BusFinding]) -> list[str]:
    TroubleLog().log(findings)
    return caplog.messages


def test_what_is_new_is_reported_at_once_even_at_time_zero(caplog: pytest.LogCaptureFixture) -> None:
    found = [
        BusFinding(Fault.PASSIVE, 0, "receive errors"),
        BusFinding(Fault.PASSIVE, 0, "transmit errors"),
        BusFinding(Fault.BUS_OFF, 1),
        BusFinding(Fault.LINK_UP, 2, "can0"),
    ]
    assert lines(caplog, found) == [
        "bus: controller is error passive (receive errors)",
        "bus: controller is error passive (transmit errors)",
        "bus: bus off",
        "bus: interface is up again (can0)",
    ]


def test_a_storm_is_one_line_a_second_with_its_count(caplog: pytest.LogCaptureFixture) -> None:
    storm = [BusFinding(Fault.NO_ACK, number * S // 100) for number in range(251)]
    assert lines(caplog, storm) == [
        "bus: no acknowledgement",
        "bus: no acknowledgement, 99 more since the last line",
        "bus: no acknowledgement, 99 more since the last line",
    ]


def test_error_counters_alone_are_not_reported(caplog: pytest.LogCaptureFixture) -> None:
    assert (
        lines(caplog, [BusFinding(Fault.COUNTERS, number, f"transmit {number}") for number in (1, 2)]) == []
    )
