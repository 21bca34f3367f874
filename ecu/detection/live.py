"""The detection in the live loop: the cycle's inputs in, inputs without what is faulty out, and what was found.

A signal that jumped is replaced by its sample less the jump for REPLACED_S, from the jump on, also while it waits for others
that explain it; one pressure by what the other one means. Estimates from them stay valid. Every other faulty signal is not usable, so that the estimators go on without it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dbc.database import Database
from ecu.calibration import Calibration
from ecu.codes import Mode
from ecu.detection.bucket import pressure_from_other
from ecu.detection.detector import cycles, initial
from ecu.detection.layout import (
    BY_FREEZE,
    BY_JUMP,
    F_COUPLE,
    FAULTY,
    FILTERS,
    JUMP,
    JUMPED,
    MODE,
    REJECTED,
    RESIDUALS,
    SAMPLE,
    SINCE,
    SIZE,
    SUSPECTED,
    UNDECIDED,
)  # fmt: skip
from ecu.detection.machine import HALF_CYCLE
from ecu.detection.rules import height_for, rules_array
from ecu.findings import EstimatorFailed, FaultFound
from ecu.inputs import GROUP_OF, OUTSIDE_ESTIMATES, CycleInputs
from ecu.watched import COUNT, LIFT, MESSAGES, NAMES, PLACE, TILT

REPLACED_S: Final = 1.0
"""How long a sample less its jump stands in for a faulty signal: spikes end within it, an offset may change."""
_TICK_NS: Final = 10_000_000
_ALIKE: Final = 0.3
"""Two signals that jumped against each other, equally far to within this share, are exchanged."""


MESSAGE_PLACES: Final = tuple(list(dict.fromkeys(MESSAGES)).index(message) for message in MESSAGES)
"""The number of each signal's message among those that are watched."""


def rules_of(calibration: Calibration, database: Database) -> tuple[NDArray[np.float64], float]:
    """What the compiled detection needs of a calibration: thresholds, and the height of the sequential tests."""
    rules = calibration.detection
    ticks = {
        name: max(database.by_name[message].cycle_ns / _TICK_NS, 1.0)
        for name, message in zip(NAMES, MESSAGES, strict=True)
    }
    return rules_array(rules, ticks, calibration.parameters), height_for(rules.false_alarms / 3.0)


class Detection:
    """The detection of one ECU, from cycle to cycle."""

    def __init__(self, calibration: Calibration, database: Database) -> None:
        self._parameters, self._tolerances = calibration.parameters, calibration.detection.tolerances
        self._database = database
        self._rules, self._height = rules_of(calibration, database)
        self._message = np.array(MESSAGE_PLACES)
        self._samples, self._usable, self._dt = np.zeros(COUNT), np.ones(COUNT), np.zeros(1)
        self._heard = np.zeros(COUNT, np.int64)
        self._patterns: dict[tuple[frozenset[str], ...], tuple[np.ndarray, np.ndarray]] = {}
        self._residuals, self._bounds = np.zeros(RESIDUALS), np.zeros(RESIDUALS)
        self._state = initial()
        self._known: frozenset[str] = frozenset()  # faulty signals of the last cycle
        self._running: Iterator[int] = self._start()

    def _start(self) -> Iterator[int]:
        return cycles(
            self._samples, self._heard, self._usable, self._message, self._parameters, self._tolerances, self._rules,
            self._height, self._state, self._dt, self._residuals, self._bounds,
        )  # fmt: skip

    def change(self, calibration: Calibration) -> None:
        """Go on with another calibration's parameters; its rules of the detection are those of before, and what is known of faults stays."""
        if calibration.parameters == self._parameters:
            return
        self._parameters = calibration.parameters
        self._rules, self._height = rules_of(calibration, self._database)
        self._running = self._start()

    def reset(self) -> None:
        """Forget all cycles; compiles at the first call."""
        self._state[:] = 0.0
        self._known = _NONE

    def look(
        self, received: CycleInputs, dt: float, now_ns: int
    ) -> tuple[CycleInputs, list[FaultFound | EstimatorFailed]]:
        """One cycle: the inputs that may be relied on, and faults that are new. dt: since the last one [s].

        A residual that cannot be computed is a finding; the detection then begins anew, and the inputs pass as they are.
        """
        values = received.values
        self._samples[:] = [values[name] for name in NAMES]
        self._heard[:], self._usable[:] = self._pattern(received)
        self._dt[0] = dt
        try:
            return self._looked(received, now_ns)
        except (ArithmeticError, ValueError) as failure:
            # An exception ends the compiled loop for good.
            self.reset()
            self._running = self._start()
            return received, [EstimatorFailed(f"fault detection: {failure}", now_ns)]

    def _looked(
        self, received: CycleInputs, now_ns: int
    ) -> tuple[CycleInputs, list[FaultFound | EstimatorFailed]]:
        """The next step of the compiled loop, and what follows from it."""
        if next(self._running) == 0:
            self._known = _NONE
            return received, []
        faulty = frozenset(NAMES[k] for k in np.flatnonzero(self._state[FAULTY, :COUNT]))
        new = faulty - self._known
        self._known = faulty
        found: list[FaultFound | EstimatorFailed] = [
            FaultFound(names, mode, now_ns) for names, mode in self._said(new)
        ]
        return self._without(received, faulty, self._suspects()), found

    def _suspects(self) -> Mapping[str, float]:
        """Signals with a jump that others may still explain, each with its sample less the jump."""
        waiting = (self._state[SUSPECTED, :COUNT] > 0.0) & (self._state[FAULTY, :COUNT] == 0.0)
        return {NAMES[k]: self._samples[k] - self._state[JUMPED, k] for k in np.flatnonzero(waiting)}

    def _pattern(self, received: CycleInputs) -> tuple[np.ndarray, np.ndarray]:
        """Which samples came, and which of them other checks accept; kept, because there are few patterns."""
        key = received.heard, received.unusable, received.stepped
        pattern = self._patterns.get(key)
        if pattern is None:
            usable = np.array([name not in received.unusable for name in NAMES], float)
            came = np.array([message in received.heard for message in MESSAGES])
            stepped = np.array([name in received.stepped for name in NAMES])
            pattern = (came & (usable > 0)) * SAMPLE + (came & stepped) * REJECTED, usable
            if len(self._patterns) < 256:
                self._patterns[key] = pattern
        return pattern

    def _said(self, new: frozenset[str]) -> Iterator[tuple[tuple[str, ...], Mode]]:
        """The new faults, each with its failure mode; signals of which any one could be wrong together."""
        undecided = tuple(sorted(name for name in new if self._state[MODE, PLACE[name]] == UNDECIDED))
        if undecided:
            yield undecided, Mode.ROOT_CAUSE_NOT_KNOWN
        for name in sorted(new - set(undecided)):
            yield (name,), self._mode(PLACE[name])

    def _mode(self, place: int) -> Mode:
        mode, jumped = self._state[MODE, place], self._state[JUMPED]
        if mode == BY_FREEZE:
            return Mode.NOT_RESPONDING
        if mode != BY_JUMP:
            return Mode.DRIFTED_HIGH if self._state[SIZE, place] > 0.0 else Mode.DRIFTED_LOW
        for other in np.flatnonzero(self._message == self._message[place]):
            against = jumped[place] + jumped[other]
            if other != place and abs(against) < _ALIKE * abs(jumped[place]) and self._state[FAULTY, other]:
                return Mode.EXCHANGED
        return Mode.RATE_OF_CHANGE

    def _without(
        self, received: CycleInputs, faulty: frozenset[str], suspects: Mapping[str, float]
    ) -> CycleInputs:
        replaced = self._replaced(faulty)
        lost = faulty - set(replaced)
        groups = {GROUP_OF[MESSAGES[PLACE[name]]] for name in lost} - OUTSIDE_ESTIMATES
        return replace(
            received,
            values={**received.values, **suspects, **replaced},
            unusable=received.unusable | lost,
            implausible=received.implausible | groups,
            doubted=faulty,
        )

    def _replaced(self, faulty: frozenset[str]) -> Mapping[str, float]:
        found: dict[str, float] = {}
        for name in faulty:
            place = PLACE[name]
            jumped, since = self._state[JUMPED, place], self._state[SINCE, place]
            away = abs(jumped) > self._rules[JUMP, place] / 2.0
            if self._state[MODE, place] == BY_JUMP and since < REPLACED_S - HALF_CYCLE:
                found[name] = self._samples[place] - (jumped if away else 0.0)
            elif place in (LIFT, TILT) and not faulty & ({*_PRESSURES} - {name} | _POSE):
                couple = self._state[FILTERS, F_COUPLE]
                found[name] = pressure_from_other(self._samples, place, couple, self._parameters)
        return found


_NONE: Final[frozenset[str]] = frozenset()
_PRESSURES: Final = ("lift_pressure", "tilt_pressure")
_POSE: Final = {"lift_arm_angle", "tilt_angle"}
