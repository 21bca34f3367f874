"""Trouble codes: what failed and how, how often, whether it still does, and how the machine stood when it began.

In the manner of J1939-73. A code is a suspect parameter (SPN) with a failure mode (FMI). It becomes active when
its fault occurs, stays active while the fault goes on, and is previously active from HOLD_NS after its last
occurrence. The table of SPNs is that of the DBC. Three messages carry the codes, one code per frame, in turn.
"""

import enum
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from dbc.database import Database
from dbc.packing import Signals

HOLD_NS: Final = 1_000_000_000
"""A fault that strikes a frame now and then stays one fault."""
MOST_OCCURRENCES: Final = 126
MANUFACTURERS: Final = 7
"""Top three bits of an SPN of the manufacturer's range."""
NO_CODE: Final = 458_752.0
"""The SPN signal's value when there is no code: raw 0."""
NO_FROZEN: Final = 520_192.0
EVERY_TICKS: Final = 10
"""The messages go out once in so many ticks; each shows the next code."""
ESTIMATORS: Final = "estimators"
ACTIVE, PREVIOUS, FROZEN_FRAME = "ActiveFaults", "PreviousFaults", "FaultFreezeFrame"


class Mode(enum.IntEnum):
    """Failure modes of J1939-73 that the ECU distinguishes; values are those of the DBC's Fmi."""

    ERRATIC = 2
    ABOVE_RANGE = 3
    BELOW_RANGE = 4
    NOT_RESPONDING = 7  # stands still
    UPDATE_RATE = 9
    RATE_OF_CHANGE = 10
    ROOT_CAUSE_NOT_KNOWN = 11  # one of the signals with this mode
    BAD_DEVICE = 12
    EXCHANGED = 14
    DATA_IN_ERROR = 19  # protection of the frame failed
    DRIFTED_HIGH = 20
    DRIFTED_LOW = 21


class FreezeFrame(NamedTuple):
    """How the machine stood when a code became active, SI."""

    value: float  # of the signal, as a share of its largest plausible magnitude
    speed: float  # [m/s]
    articulation_angle: float  # [rad]
    lift_arm_angle: float  # [rad]
    at: float  # since the ECU started [s]


@dataclass(slots=True)
class TroubleCode:
    """One code with its history since start."""

    name: str  # of the suspect parameter, as in the DBC's table
    spn: int
    mode: Mode
    occurrences: int
    active: bool
    last_ns: int
    frozen: FreezeFrame


class TroubleCodes:
    """All codes since start; there are no more than suspect parameters times failure modes."""

    def __init__(self, database: Database) -> None:
        signal = database.by_name[ACTIVE].by_signal["Spn"]
        self._spns = {name: int(raw * signal.scale + signal.offset) for raw, name in signal.choices.items()}
        self._codes: dict[tuple[str, Mode], TroubleCode] = {}
        self._active: list[TroubleCode] = []
        self._previous: list[TroubleCode] = []

    @property
    def active(self) -> tuple[TroubleCode, ...]:
        """The active codes, the oldest first."""
        return tuple(self._active)

    @property
    def previous(self) -> tuple[TroubleCode, ...]:
        """The previously active codes, the oldest first."""
        return tuple(self._previous)

    def possible(self) -> list[tuple[int, Mode]]:
        """SPN and failure mode of every code that there can be, in the order of the DBC's table."""
        return [(spn, mode) for name, spn in self._spns.items() if spn != NO_CODE for mode in _modes_of(name)]

    def clear(self) -> None:
        """Forget the previous codes. Those whose fault is there now stay, as if it had occurred for the first time.

        Faults are found when they begin: an active code that was forgotten would not come back while its fault goes on.
        """
        self._codes = {key: code for key, code in self._codes.items() if code.active}
        for code in self._codes.values():
            code.occurrences = 1
        self._sort()

    def occurred(self, name: str, mode: Mode, now_ns: int, frozen: FreezeFrame) -> bool:
        """A fault is there; whether its code was not active before. KeyError for a name without an SPN."""
        code = self._codes.get((name, mode))
        if code is None:
            code = TroubleCode(name, self._spns[name], mode, 0, False, now_ns, frozen)
            self._codes[name, mode] = code
        code.last_ns = now_ns
        if code.active:
            return False
        code.active, code.frozen = True, frozen
        code.occurrences = min(code.occurrences + 1, MOST_OCCURRENCES)
        self._sort()
        return True

    def continued(self, names: Collection[str], now_ns: int) -> None:
        """Active codes of these suspect parameters go on; those whose time is over become previous."""
        if not self._active:
            return
        ended = False
        for code in self._active:
            if code.name in names:
                code.last_ns = now_ns
            elif now_ns - code.last_ns > HOLD_NS:
                code.active, ended = False, True
        if ended:
            self._sort()

    def _sort(self) -> None:
        codes = self._codes.values()
        self._active = [code for code in codes if code.active]
        self._previous = [code for code in codes if not code.active]

    def values(self, tick: int, *, invalid: bool, stopped: bool) -> Mapping[str, float]:
        """Content of the three messages at a tick, by the names of `CODE_VALUES`.

        invalid: whether an estimate is; stopped: whether the estimators are.
        """
        if not self._codes:
            return NOTHING
        turn = tick // EVERY_TICKS
        lamps = (bool(self._active), invalid and bool(self._active), stopped)
        return {
            **NOTHING,
            **_message(ACTIVE, self._active, turn, lamps),
            **_message(PREVIOUS, self._previous, turn, (False, False, False)),
            **_frozen((*self._active, *self._previous), turn),
        }


def _modes_of(name: str) -> tuple[Mode, ...]:
    """The failure modes that a suspect parameter of this name can have."""
    if name == ESTIMATORS:
        return (Mode.BAD_DEVICE,)
    if name.startswith("message_"):
        return (Mode.UPDATE_RATE, Mode.DATA_IN_ERROR)
    return tuple(mode for mode in Mode if mode not in (Mode.UPDATE_RATE, Mode.DATA_IN_ERROR))


_LAMPS: Final = ("ProtectLamp", "AmberWarningLamp", "RedStopLamp")
_OF_CODE: Final = (*_LAMPS, "MalfunctionLamp", "Spn", "Fmi", "SpnTop", "OccurrenceCount", "Place", "Codes")


def _units(message: str, signals: Iterable[str]) -> dict[str, tuple[str, str]]:
    return {name: ("1", f"{message} {name}") for name in signals}


CODE_VALUES: Final[Mapping[str, Signals]] = {
    ACTIVE: _units(ACTIVE, _OF_CODE),
    PREVIOUS: _units(PREVIOUS, _OF_CODE),
    FROZEN_FRAME: {
        "Spn": ("1", f"{FROZEN_FRAME} Spn"),
        "Value": ("1", f"{FROZEN_FRAME} Value"),
        "Speed": ("m/s", f"{FROZEN_FRAME} Speed"),
        "ArticulationAngle": ("rad", f"{FROZEN_FRAME} ArticulationAngle"),
        "LiftArmAngle": ("rad", f"{FROZEN_FRAME} LiftArmAngle"),
        "At": ("s", f"{FROZEN_FRAME} At"),
    },
}
"""What the three messages carry: message -> signal -> (SI unit, name of the value)."""

NOTHING: Final[Mapping[str, float]] = {
    name: NO_FROZEN if name == f"{FROZEN_FRAME} Spn" else NO_CODE if name.endswith(" Spn") else 0.0
    for signals in CODE_VALUES.values()
    for _, name in signals.values()
}
"""The messages while there has been no code."""


def _message(
    message: str, codes: list[TroubleCode], turn: int, lamps: tuple[bool, bool, bool]
) -> dict[str, float]:
    lit = {f"{message} {lamp}": float(on) for lamp, on in zip(_LAMPS, lamps, strict=True)}
    if not codes:
        return lit
    place = turn % len(codes)
    code = codes[place]
    return lit | {
        f"{message} Spn": float(code.spn),
        f"{message} Fmi": float(code.mode),
        f"{message} SpnTop": float(MANUFACTURERS),
        f"{message} OccurrenceCount": float(code.occurrences),
        f"{message} Place": place + 1.0,
        f"{message} Codes": float(len(codes)),
    }


def _frozen(codes: tuple[TroubleCode, ...], turn: int) -> dict[str, float]:
    code = codes[turn % len(codes)]
    frame = code.frozen
    return {
        f"{FROZEN_FRAME} Spn": float(code.spn),
        f"{FROZEN_FRAME} Value": frame.value,
        f"{FROZEN_FRAME} Speed": frame.speed,
        f"{FROZEN_FRAME} ArticulationAngle": frame.articulation_angle,
        f"{FROZEN_FRAME} LiftArmAngle": frame.lift_arm_angle,
        f"{FROZEN_FRAME} At": frame.at,
    }
