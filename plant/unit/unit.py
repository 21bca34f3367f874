"""The machine as a unit on the bus: frames and stamps in, frames out. No clock, socket or log in here.

One tick is 10 ms of the machine's own time:

    driver looks at the last readings and moves pedals and joystick
    the request is cut to the limits in force
    the dynamics advance with the commands held
    sensors sample; the frames that are due are made

Equal machine, scenario, seed and received frames give equal bytes.
"""

import math
from collections.abc import Sequence
from typing import Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.machine_code import direct
from bus.rows import Rows, frames_of
from dbc import loader_database, reference_database
from dbc.schedule import FrameSchedule
from plant.physics.state import COMMANDS
from plant.plant import Commands, Plant
from plant.sheets.machine import Machine
from plant.truth import Truth
from plant.unit import interface
from plant.unit.actuators import abilities_of
from plant.unit.control import DEMAND, Fitted, control, ground_speed
from plant.unit.driver import Demand
from plant.unit.limits import UNLIMITED, Limits, in_force
from plant.unit.reception import Finding, Reception
from plant.unit.scenario import Scenario
from plant.unit.sensors import Floats, Readings, SensorBank, faulty, felt_values, measured_values
from plant.unit.signals import (
    CHANNELS,
    GROUND_SPEED,
    MACHINE,
    MACHINE_MESSAGES,
    OWN,
    REFERENCE_MESSAGES,
    SEQUENCE,
    TEST_RIG,
)

TICK_NS: Final = 10_000_000
TICK_S: Final = TICK_NS * 1e-9
SEQUENCES: Final = 1 << 16
ROLLED_OVER: Final = math.radians(60.0)
"""Roll beyond any recovery; the frames would touch the ground, and that contact is not modelled."""


class Motion(Protocol):
    """What the unit needs of its dynamics."""

    def advance(self, commands: Commands, duration_s: float) -> Truth:
        """Move on; returns what is true then."""
        ...

    def truth(self) -> Truth: ...


@runtime_checkable
class MotionByVector(Protocol):
    """Dynamics that take their commands as a vector, which costs less than an object for each tick."""

    def advance_by(self, command: Floats, duration_s: float) -> Truth:
        """The same as `Motion.advance`; command: finite, in the order of `Commands.vector`."""
        ...


class PlantUnit:
    """Plant, driver, actuators, sensors and bus interface of one run.

    obey_limits: False makes the machine ignore what the ECU permits (and its own safe values).
    motion: what moves in place of the plant of machine and scenario.
    """

    def __init__(
        self,
        machine: Machine,
        scenario: Scenario,
        *,
        seed: int,
        obey_limits: bool = True,
        motion: Motion | None = None,
    ) -> None:
        equipment, start = scenario.equipment, scenario.start
        self.scenario = scenario
        self._equipment = equipment
        self._obey_limits = obey_limits
        self._plant: Motion = motion or Plant(
            machine,
            surface=scenario.surface,
            payload_mass=scenario.payload_mass,
            speed=start.speed,
            articulation_angle=start.articulation_angle,
            lift_arm_angle=start.lift_arm_angle,
            tilt_angle=start.tilt_angle,
            heading=start.heading,
        )
        self._advance_by = self._plant.advance_by if isinstance(self._plant, MotionByVector) else None
        self._truth = self._plant.truth()
        self._fitted = Fitted(
            scenario.script.curves(),
            equipment.driver,
            abilities_of(machine, equipment.actuators),
            equipment.obedience,
            equipment.rolling_radius,
        )
        self._sensors = SensorBank(
            faulty(equipment.sensors, machine.effects), step=TICK_S, generator=np.random.default_rng(seed)
        )
        self._readings: Readings | None = None
        self._own, self._command = np.zeros(OWN), np.zeros(COMMANDS)
        self._values = interface.MachineValues()
        readings = np.zeros(len(CHANNELS))
        self._ground_speed = direct(ground_speed, readings, equipment.rolling_radius)
        self._control = direct(
            control, 0.0, TICK_S, readings, UNLIMITED, 0.0, 0.0, self._fitted, self._own, self._command
        )
        self._reception = Reception(loader_database())
        self._schedule = FrameSchedule(
            loader_database(),
            MACHINE,
            MACHINE_MESSAGES,
            tick_ns=TICK_NS,
            sources=interface.MACHINE_SOURCES,
        )
        self._reference = FrameSchedule(
            reference_database(),
            TEST_RIG,
            REFERENCE_MESSAGES,
            tick_ns=TICK_NS,
            sources=interface.REFERENCE_SOURCES,
        )
        self._ticks = 0
        self._started_ns = self._now_ns = 0  # of the first and of the last tick

    @property
    def truth(self) -> Truth:
        """The true motion at the last tick."""
        return self._truth

    @property
    def readings(self) -> Readings | None:
        """What the sensors read at the last tick; None before the first."""
        return self._readings

    @property
    def demand(self) -> Demand:
        """The driver's present demand."""
        return Demand(*self._own[:DEMAND].tolist())

    @property
    def sequence(self) -> int:
        """Sequence number of the last sample."""
        return (self._ticks - 1) % SEQUENCES

    @property
    def rolled_over(self) -> bool:
        """Whether the machine lies so far on its side that the run ends."""
        return abs(self._truth.roll) > ROLLED_OVER

    @property
    def finished(self) -> bool:
        """Whether the scenario is over: its time is up, or the machine lies on its side."""
        return self.rolled_over or self._ticks * TICK_S >= self.scenario.duration_s + 0.5 * TICK_S

    @property
    def reception(self) -> Reception:
        """What came from the ECU."""
        return self._reception

    @property
    def wanted(self) -> frozenset[int]:
        """Identifiers of the frames that `receive` looks at."""
        return self._reception.wanted

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Take one frame from the bus; findings if its protection (CRC, counter) fails."""
        return self._reception.receive(frame, now_ns)

    def limits_in_force(self, now_ns: int) -> Limits:
        """The limits the machine obeys at `now_ns`."""
        return in_force(*self._received(now_ns), self._equipment.obedience)

    def _received(self, now_ns: int) -> tuple[Limits, float, float]:
        """The last limits, their age and that of those of the linkage [s], as `in_force` takes them."""
        if not self._obey_limits:
            return UNLIMITED, 0.0, 0.0
        reception = self._reception
        since_ns = max(reception.limits_ns, self._started_ns)
        linkage_ns = now_ns if reception.linkage_ns is None else reception.linkage_ns
        return reception.limits, (now_ns - since_ns) * 1e-9, (now_ns - linkage_ns) * 1e-9

    def tick(self, now_ns: int) -> list[Frame]:
        """Advance 10 ms and return the sensor frames that are due. The first tick samples the start."""
        values = self._sampled(now_ns)
        return self._schedule.pack(self._ticks - 1, values)

    def tick_rows(self, now_ns: int) -> tuple[Rows, int]:
        """The same; the frames as rows, and how many."""
        values = self._sampled(now_ns)
        return self._schedule.fill(self._ticks - 1, values)

    def _sampled(self, now_ns: int) -> Floats:
        """Advance 10 ms and return everything the machine sends."""
        self._now_ns = now_ns
        if self._readings is None:
            self._started_ns = now_ns
        else:
            self._advance(self._readings, now_ns)
        self._readings = self._sensors.sample(measured_values(self._truth), felt_values(self._truth))
        self._ticks += 1
        own = self._own
        own[SEQUENCE] = self.sequence
        own[GROUND_SPEED] = abs(self._ground_speed(self._readings.values, self._equipment.rolling_radius))
        return self._values.of(self._readings, own)

    def reference_frames(self) -> list[Frame]:
        """The test instrumentation's frames that are due at the last tick, with its stamp."""
        values = interface.reference_values((self._truth,))[0]
        if not np.isfinite(values).all():  # a motion from elsewhere may know no tyre forces
            return []
        return self._reference.pack(self._ticks - 1, values, self._now_ns)

    def reference_of(self, truths: Sequence[Truth], first: int, at_ns: int) -> list[Frame]:
        """The test instrumentation's frames of ticks that follow one another; number and stamp of the first of them."""
        return frames_of(self.reference_rows(truths, first, at_ns))

    def reference_rows(self, truths: Sequence[Truth], first: int, at_ns: int) -> NDArray[np.void]:
        """The same as a table of bus.rows.LAYOUT.

        Many ticks together cost a quarter of one after the other. A motion that lacks a value has no frames at that tick.
        """
        values = interface.reference_values(truths)
        known = np.flatnonzero(np.isfinite(values).all(axis=1))
        return self._reference.pack_many(
            (first + known).tolist(), values[known], (at_ns + TICK_NS * known).tolist()
        )

    def _advance(self, readings: Readings, now_ns: int) -> None:
        """Driver, limits and dynamics, from the last sample to now."""
        limits, age, linkage_age = self._received(now_ns)
        finite = self._control(
            (self._ticks - 1) * TICK_S,
            TICK_S,
            readings.values,
            limits,
            age,
            linkage_age,
            self._fitted,
            self._own,
            self._command,
        )
        if finite and self._advance_by is not None:
            self._truth = self._advance_by(self._command, TICK_S)
        else:
            self._truth = self._plant.advance(Commands.of(self._command), TICK_S)
