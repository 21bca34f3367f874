"""The ECU's cycle: frames and times in, frames and findings out.

No clock, bus, asyncio or logging here. The shell calls `receive` for every frame and `tick` every
10 ms, and reports how long the last tick took and how many ticks were skipped.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from bus.frame import Frame
from dbc import loader_database
from dbc.database import Database
from ecu import limits, reasons
from ecu.alarms import Alarm, advanced
from ecu.calibration import Calibration
from ecu.codes import TroubleCodes
from ecu.consistency import Consistency
from ecu.detection.live import Detection
from ecu.detection.troubles import Troubles
from ecu.estimators.live import LiveEstimator
from ecu.estimators.signals import Estimates
from ecu.findings import EstimatorFailed, Finding, ProtectionFailed, Stale, StateChanged
from ecu.inputs import OUTSIDE_ESTIMATES, CycleInputs, Group, InputReceiver, estimator_inputs
from ecu.outputs import MOST_TICKS, TICK_NS, Outputs
from ecu.states import Event, State, after
from ecu.validity import NOTHING, unknown_deviations, valid_without

Form = Literal["corrected", "printed"]
NO_ESTIMATES: Final = Estimates(*([0.0] * len(Estimates._fields)))
MOST_OVERRUNS: Final = 1023
LEVER_LIMITS: Final = tuple(
    f"limit {way} rate" for way in ("lift up", "lift down", "tilt back", "tilt forward")
)


@dataclass(frozen=True, slots=True)
class Tick:
    """What one cycle gives: frames to send, findings to log, and the estimates themselves."""

    frames: list[Frame]
    findings: list[Finding]
    estimates: Estimates


class EcuCycle:
    """One ECU. form: estimator equations, corrected or as printed; limits_enabled: False only warns.

    detect_faults: whether sensors are tested against each other; a signal that is called faulty is no longer used.
    """

    def __init__(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits_enabled: bool = True,
        detect_faults: bool = False,
        database: Database | None = None,
    ) -> None:
        database = database or loader_database()
        self._calibration = calibration
        self._parameters = calibration.parameters
        self._estimator = LiveEstimator(self._parameters, form)
        self._limits_enabled = limits_enabled
        self._database = database
        self._receiver = InputReceiver(calibration, database)
        self._consistency = Consistency(self._parameters.wheel, database)
        self._outputs = Outputs(database)
        self._detection = Detection(calibration, database) if detect_faults else None
        self._troubles = Troubles(calibration.inputs, database)
        self._heard: list[Finding] = []  # findings on frames since the last tick
        self._state = State.INIT
        self._unlimited = limits.unlimited(calibration.limits, self._parameters.prediction)
        self._limits = limits.safe(calibration.limits)
        self._stale: frozenset[Group] = frozenset()
        self._times = reasons.times(calibration.alarms)
        self._alarms: Mapping[str, Alarm] = {}
        self._ticks = 0
        self._started_ns: int | None = None  # when the first frame was received
        self._bad_ns = self._fault_ns = -1  # when an input was last bad, and when an estimator last failed
        self._previous_ns: int | None = None
        self._execution_ns = 0
        self._overruns = 0
        self._overran = False  # since the last tick, as is the next
        self._protection_failed = False
        self._values_now: Mapping[str, float] = {}
        self._inputs_now: Mapping[str, float] = {}

    @property
    def calibration(self) -> Calibration:
        """The numbers that the cycle works with at present."""
        return self._calibration

    @property
    def values(self) -> Mapping[str, float]:
        """What the last cycle found, by the names of `ecu.outputs.messages` and of `Estimates`, SI; {} before the first."""
        return self._values_now

    @property
    def inputs(self) -> Mapping[str, float]:
        """The input values of the last cycle, by the names of the signal table, SI; {} before the first."""
        return self._inputs_now

    @property
    def trouble_codes(self) -> TroubleCodes:
        """The codes since start."""
        return self._troubles.codes

    @property
    def state(self) -> State:
        """The state of the cycle."""
        return self._state

    def recalibrate(self, calibration: Calibration) -> None:
        """Work with another calibration from the next cycle on; what the estimators and alarms have learnt is kept.

        Raises ValueError if it differs in what is fixed at the start: geometry, rules of the inputs, the detection.
        """
        old, wheel = self._calibration, calibration.parameters.wheel
        if (
            calibration.inputs != old.inputs
            or calibration.detection != old.detection
            or calibration.parameters.geometry != old.parameters.geometry
            or wheel.unloaded_radius != old.parameters.wheel.unloaded_radius
        ):
            raise ValueError(f"calibration {calibration.name}: differs in what is fixed while the ECU runs")
        self._calibration, self._parameters = calibration, calibration.parameters
        self._estimator.change(calibration.parameters)
        self._consistency.change(wheel)
        if self._detection is not None:
            self._detection.change(calibration)
        self._unlimited = limits.unlimited(calibration.limits, calibration.parameters.prediction)
        self._times = reasons.times(calibration.alarms)

    def restart(self) -> None:
        """Begin anew as after power-on: inputs, learnt loads and alarms are forgotten, limits are safe. Trouble codes stay."""
        self._receiver = InputReceiver(self._calibration, self._database)
        self._estimator.reset()
        self._consistency.forget()
        if self._detection is not None:
            self._detection.reset()
        self._state, self._limits = State.INIT, limits.safe(self._calibration.limits)
        self._stale, self._alarms = frozenset(), {}
        self._heard.clear()
        self._started_ns = self._previous_ns = None
        self._bad_ns = self._fault_ns = -1
        self._overran = self._protection_failed = False

    def warm_up(self) -> None:
        """Compile the estimators, so that the first cycle is as fast as the others."""
        self._estimator.estimate(estimator_inputs(self._receiver.gather(0), TICK_NS * 1e-9, 1.0))
        self._estimator.reset()
        if self._detection is not None:
            self._detection.look(self._receiver.gather(0), TICK_NS * 1e-9, 0)
            self._detection.reset()

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Take one frame from the bus."""
        if self._started_ns is None:
            self._started_ns = now_ns
        found = self._receiver.receive(frame, now_ns)
        self._heard += found
        if found and any(isinstance(finding, ProtectionFailed) for finding in found):
            self._protection_failed = True
        return found

    def executed(self, execution_ns: int) -> None:
        """The last tick took this long."""
        self._execution_ns = execution_ns

    def overran(self, skipped: int) -> None:
        """The shell had to skip ticks."""
        self._overruns = min(self._overruns + skipped, MOST_OVERRUNS)
        self._overran = True

    def tick(self, now_ns: int) -> Tick:
        """One cycle at `now_ns`."""
        received = self._receiver.gather(now_ns)
        findings: list[Finding] = [
            Stale(g.name.lower(), now_ns) for g in sorted(received.stale - self._stale)
        ]
        self._stale = received.stale
        if self._detection is not None and self._state in (State.RUNNING, State.DEGRADED):
            received, doubts = self._detection.look(received, self._period(now_ns), now_ns)
            findings += doubts
        findings += self._move(self._input_event(received, now_ns), now_ns)
        estimates, flags, failed = self._estimates(received, now_ns)
        findings += failed
        self._troubles.step((*self._heard, *findings), received, estimates.speed, now_ns)
        self._heard.clear()
        self._limits = self._next_limits(estimates, flags, now_ns)
        valid = self._consistency.valid(estimates, flags, now_ns)
        self._alarms = self._next_alarms(estimates, flags, valid, received, now_ns)
        values = self._values(estimates, flags, valid, received)
        self._values_now, self._inputs_now = values, received.values
        frames = self._outputs.frames(self._ticks, values)
        self._previous_ns = now_ns
        self._ticks += 1
        return Tick(frames, findings, estimates)

    def _input_event(self, received: CycleInputs, now_ns: int) -> Event:
        unusable = (received.stale | received.implausible) - OUTSIDE_ESTIMATES
        if unusable:
            self._bad_ns = now_ns
        if not unusable:
            if self._state is State.FAULT and self._recovered(now_ns):
                return Event.RECOVERED
            return Event.INPUTS_GOOD
        waiting_ns = now_ns - self._started_ns if self._started_ns is not None else 0
        waited = waiting_ns * 1e-9 > self._calibration.inputs.start_up
        return Event.START_UP_OVER if self._state is State.INIT and waited else Event.INPUTS_BAD

    def _move(self, event: Event, now_ns: int) -> list[Finding]:
        before, self._state = self._state, after(self._state, event)
        if before is self._state:
            return []
        if before is State.FAULT and self._detection is not None:
            # What the detection held against signals was of the time before: good inputs have lasted for the time to recover.
            self._detection.reset()
        if before is State.INIT and self._state is State.RUNNING and self._fault_ns < 0:
            self._limits = self._unlimited  # at the start there is nothing to rise slowly from
        return [StateChanged(before, self._state, event, now_ns)]

    def _recovered(self, now_ns: int) -> bool:
        """Whether fault and bad inputs have been gone for the time to recover."""
        since_ns = max(self._bad_ns, self._fault_ns)
        return (now_ns - since_ns) * 1e-9 >= self._calibration.inputs.recovery

    def _period(self, now_ns: int) -> float:
        """Time since the previous cycle [s], in whole periods, MOST_TICKS at most: the sensors sample by the same clock."""
        if self._previous_ns is None:
            return TICK_NS * 1e-9
        return min(max(round((now_ns - self._previous_ns) / TICK_NS), 1), MOST_TICKS) * TICK_NS * 1e-9

    def _estimates(
        self, received: CycleInputs, now_ns: int
    ) -> tuple[Estimates, Mapping[str, bool], list[Finding]]:
        """Estimates, which of them are valid, and findings. Estimators that fail start anew after a fault."""
        if self._state not in (State.RUNNING, State.DEGRADED):
            return NO_ESTIMATES, NOTHING, []
        inputs = estimator_inputs(received, self._period(now_ns), self._limits.rate, self._limits.levers)
        error = "an estimate is not a number"
        try:
            estimates = self._estimator.estimate(inputs)
        except (ArithmeticError, ValueError) as failure:  # division by zero, domain of a function
            error = str(failure)
        else:
            if all(map(math.isfinite, estimates)):
                return estimates, valid_without(received.unusable), []
        self._estimator.reset()
        self._fault_ns = now_ns
        moved = self._move(Event.INTERNAL_ERROR, now_ns)
        return NO_ESTIMATES, NOTHING, [EstimatorFailed(error, now_ns), *moved]

    def _next_limits(self, estimates: Estimates, flags: Mapping[str, bool], now_ns: int) -> limits.Limits:
        rules = self._calibration.limits
        if not self._limits_enabled:
            return self._unlimited
        if not flags["roll_over"]:
            return limits.safe(rules)
        dt, times = self._period(now_ns), self._times[reasons.PREVENTION]
        drive = self._parameters.linkage_drive
        return limits.next_limits(self._limits, estimates, now_ns, dt, times, rules, self._unlimited, drive)

    def _next_alarms(
        self,
        e: Estimates,
        flags: Mapping[str, bool],
        valid: Mapping[str, bool],
        received: CycleInputs,
        now_ns: int,
    ) -> dict[str, Alarm]:
        rules, stop = self._calibration.warnings, self._parameters.geometry.articulation_stop
        found = {
            **reasons.conditions(e, received, flags, stop, rules),
            **reasons.roll_over_conditions(e, flags["roll_over"], self._alarms, rules),
            "EstimateInvalid": not all(valid.values()),
            "ProtectionError": self._protection_failed,
            "CycleOverrun": self._overran,
        }
        self._protection_failed = self._overran = False
        return advanced(self._alarms, found, now_ns, self._times)

    def _values(
        self, e: Estimates, flags: Mapping[str, bool], valid: Mapping[str, bool], received: CycleInputs
    ) -> dict[str, float]:
        """Everything that goes into a frame, by name, SI."""
        raised = {name: self._alarms[name].on for name in reasons.REASONS}
        acting, now = self._limits, self._unlimited
        prevents = acting.cause in (limits.Cause.ROLL_OVER_PREVENTION, limits.Cause.SAFE_VALUES)
        return {
            **e._asdict(),
            **unknown_deviations(e, valid),
            **{f"{name} valid": float(flag) for name, flag in valid.items()},
            **{f"reason {name}": float(flag) for name, flag in raised.items()},
            "warning level": float(reasons.level(raised)),
            "roll-over state": float(reasons.roll_over_state(self._alarms, flags["roll_over"])),
            "limit front torque": acting.front_torque,
            "limit rear torque": acting.rear_torque,
            "limit speed": acting.speed,
            "limit rate": acting.rate,
            "limit cause": float(acting.cause),
            **dict(zip(LEVER_LIMITS, acting.levers, strict=True)),
            "linkage limit cause": float(acting.lever_cause),
            **self._troubles.codes.values(
                self._ticks, invalid=not all(valid.values()), stopped=self._state is State.FAULT
            ),
            "prevention limits torque": float(prevents and acting.front_torque < now.front_torque),
            "prevention limits speed": float(prevents and acting.speed < now.speed),
            "echo": received.values["sequence"],
            "execution time": self._execution_ns * 1e-9,
            "overruns": float(self._overruns),
            "state": float(self._state),
            "stale inputs": float(
                sum(1 << group for group in received.stale if group not in OUTSIDE_ESTIMATES)
            ),
        }
