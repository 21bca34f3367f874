"""Computes the path of every reaction, hop by hop, from the stamps of three processes. Pure: arrays in, arrays out.

A reaction begins with a sample that the ECU echoes, and ends with the first limits frame of the cycle that
echoed it. Each process identifies that frame by its position: limits since the previous status belong
to the next status. The wait for the ECU's tick (age at tick, 0 to one period) depends on chance, not on
speed: it is a hop of its own, and the reaction is given with and without it.
"""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]
Columns = Mapping[str, NDArray[np.int64]]
SEQUENCES: Final = 1 << 16
UNKNOWN: Final = -1


class Kind(enum.IntEnum):
    """Kind of a row of stamps. SENT is HEARD + 1: the tap computes one from the other."""

    HEARD_SAMPLE = 0
    SENT_SAMPLE = 1
    HEARD_LIMITS = 2
    SENT_LIMITS = 3
    HEARD_STATUS = 4
    SENT_STATUS = 5
    TICK = 6


WAY_WITH_GATEWAY: Final = (
    ("plant_sent", ""),
    ("plant_bus", "onto the plant's bus"),
    ("gateway_read", "wait for the gateway"),
    ("gateway_sent", "through the gateway"),
    ("ecu_bus", "onto the ECU's bus"),
    ("tick", "age at tick"),
    ("limits_sent", "ECU computes"),
    ("limits_ecu_bus", "limits onto the ECU's bus"),
    ("limits_gateway_read", "limits wait for the gateway"),
    ("limits_gateway_sent", "limits through the gateway"),
    ("limits_plant_bus", "limits onto the plant's bus"),
)
"""Stamps in the order of the path, each with the name of the hop that ends there."""
WAY_ON_ONE_BUS: Final = (
    ("plant_sent", ""),
    ("ecu_bus", "onto the bus"),
    ("tick", "age at tick"),
    ("limits_sent", "ECU computes"),
    ("limits_plant_bus", "limits onto the bus"),
)
AGE: Final = "age at tick"
PROCESSING: Final = "plant to plant without age at tick"
REACTION: Final = "plant to plant"


@dataclass(frozen=True, slots=True, kw_only=True)
class StampFiles:
    """Rows of the taps, shape (n, 4), see `hil.gateway.tap`; those of the gateway are empty where there is none."""

    plant: Stamps
    ecu: Stamps
    gateway_plant: Stamps
    gateway_ecu: Stamps


def way_of_reactions(files: StampFiles) -> dict[str, NDArray[np.int64]]:
    """The stamps [ns] of every complete reaction by name, in the order of the way; equal lengths."""
    gateway = files.gateway_plant.size > 0
    way = WAY_WITH_GATEWAY if gateway else WAY_ON_ONE_BUS
    found = {
        "plant_sent": _samples(files.plant, Kind.SENT_SAMPLE, 3),
        "ecu_bus": _samples(files.ecu, Kind.HEARD_SAMPLE, 2),
        **_answers(files.ecu, Kind.SENT_LIMITS, {"tick": 4, "limits_sent": 3}),
        **_answers(files.plant, Kind.HEARD_LIMITS, {"limits_plant_bus": 2}),
    }
    if gateway:
        found |= {
            "plant_bus": _samples(files.gateway_plant, Kind.HEARD_SAMPLE, 2),
            "gateway_read": _samples(files.gateway_plant, Kind.HEARD_SAMPLE, 3),
            "gateway_sent": _samples(files.gateway_ecu, Kind.SENT_SAMPLE, 3),
            **_answers(files.gateway_ecu, Kind.HEARD_LIMITS, {"limits_ecu_bus": 2, "limits_gateway_read": 3}),
            **_answers(files.gateway_plant, Kind.SENT_LIMITS, {"limits_gateway_sent": 3}),
        }
    # a reaction counts only if every process stamped it: frames that were lost on the way have none
    numbers = sorted(set.intersection(*(set(stamps) for stamps in found.values())))
    return {name: np.array([found[name][number] for number in numbers], np.int64) for name, _ in way}


def hops(way: Columns) -> dict[str, NDArray[np.int64]]:
    """Durations [ns] of every hop by its name, then of the whole path with and without age at tick."""
    described = WAY_WITH_GATEWAY if "gateway_read" in way else WAY_ON_ONE_BUS
    if not way:
        return {}
    names = [name for name, _ in described]
    durations = {
        title: way[name] - way[before] for before, (name, title) in zip(names, described[1:], strict=False)
    }
    whole = way[names[-1]] - way[names[0]]
    return {**durations, PROCESSING: whole - durations[AGE], REACTION: whole}


def _unwrapped(numbers: Stamps) -> Stamps:
    """Sequence numbers made continuous over the wrap at 16 bits; the first is in the first turn."""
    # frames are recorded in order, so two neighbours differ by far less than half a turn
    return np.rint(np.unwrap(numbers.astype(float), period=SEQUENCES)).astype(np.int64)


def _samples(rows: Stamps, kind: Kind, column: int) -> dict[int, int]:
    """The stamp in `column` of the first row of each sequence number."""
    chosen = rows[rows[:, 0] == kind]
    numbers = _unwrapped(chosen[:, 1])
    # reversed, so that the first row of a number stays: a repeated frame is not a faster one
    return dict(zip(reversed(numbers.tolist()), reversed(chosen[:, column].tolist()), strict=True))


def _answers(rows: Stamps, limits: Kind, columns: Mapping[str, int]) -> dict[str, dict[int, int]]:
    """By name, the stamp in a column of the limits that belong to the first status of each echo.

    Column 4 is the start of the tick: rows come in the order of time, but the row of a tick is written at its end, so it
    is the first TICK after the status.
    """
    status = limits + (Kind.HEARD_STATUS - Kind.HEARD_LIMITS)
    echoes = _unwrapped(rows[rows[:, 0] == status][:, 1]).tolist()
    result: dict[str, dict[int, int]] = {name: {} for name in columns}
    latest: list[int] | None = None
    waiting: int | None = None  # echo whose tick has no row yet
    place = 0
    for row in rows.tolist():
        # rows of one process in the order of time: limits, then the status that belongs to them, then the tick
        if row[0] == limits:
            latest = row
        elif row[0] == status:
            echo, place = echoes[place], place + 1
            waiting = None
            if latest is not None:
                for name, column in columns.items():
                    if column < 4:
                        result[name].setdefault(echo, latest[column])
                # the row of the tick is written at its end, after its frames: the next TICK row is the one that sent them
                waiting = echo
            latest = None
        elif row[0] == Kind.TICK and waiting is not None:
            for name, column in columns.items():
                if column == 4:
                    result[name].setdefault(waiting, row[3])
            waiting = None
    return result
