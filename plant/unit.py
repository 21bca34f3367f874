"""The machine as a unit on the bus: frames and stamps in, frames out. No clock, socket or log in here.

One tick is 10 ms of the machine's own time:

    driver looks at the last readings and moves pedals and joystick
    the request is cut to the limits in force
    the dynamics advance with the commands held
    sensors sample; the frames that are due are made

Equal machine, scenario, seed and received frames give equal bytes.
"""

import math
from typing import Final, Protocol

import numpy as np

from bus.frame import Frame
from dbc import loader_database, reference_database
from dbc.schedule import FrameSchedule
from plant import interface
from plant.actuators import Four, abilities_of, four, request_of, within_power
from plant.driver import Demand, DriverState, drive
from plant.effects.effect import faulty
from plant.limits import UNLIMITED, Limits, in_force, obey
from plant.machine import Machine
from plant.plant import Commands, Plant
from plant.reception import Finding, Reception
from plant.scenario import Scenario
from plant.sensors import WHEEL_SPEED, Readings, SensorBank, measured_values
from plant.truth import Truth

TICK_NS: Final = 10_000_000
TICK_S: Final = TICK_NS * 1e-9
SEQUENCES: Final = 1 << 16
ROLLED_OVER: Final = math.radians(
    60
)  # beyond any recovery; frames would touch the ground, which is not modelled


class Motion(Protocol):
    """What the unit needs of its dynamics."""

    def advance(self, commands: Commands, duration_s: float) -> None: ...

    def truth(self) -> Truth: ...


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
        self._truth = self._plant.truth()
        self._abilities = abilities_of(machine, equipment.actuators)
        self._sensors = SensorBank(
            faulty(equipment.sensors, machine.effects), step=TICK_S, generator=np.random.default_rng(seed)
        )
        self._readings: Readings | None = None
        self._driver = DriverState()
        self._reception = Reception(loader_database())
        self._schedule = FrameSchedule(
            loader_database(),
            interface.MACHINE,
            interface.MACHINE_MESSAGES,
            tick_ns=TICK_NS,
            sources=interface.MACHINE_SOURCES,
        )
        self._reference = FrameSchedule(
            reference_database(),
            interface.TEST_RIG,
            interface.REFERENCE_MESSAGES,
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
        """What the driver asks for."""
        return self._driver.demand

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

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Take one frame from the bus; findings if it is not as the DBC and its protection say."""
        return self._reception.receive(frame, now_ns)

    def limits_in_force(self, now_ns: int) -> Limits:
        """The limits the machine obeys at `now_ns`."""
        if not self._obey_limits:
            return UNLIMITED
        since_ns = max(self._reception.limits_ns, self._started_ns)
        return in_force(
            self._reception.limits, age=(now_ns - since_ns) * 1e-9, obedience=self._equipment.obedience
        )

    def tick(self, now_ns: int) -> list[Frame]:
        """Advance 10 ms and return the sensor frames that are due. The first tick samples the start."""
        self._now_ns = now_ns
        if self._readings is None:
            self._started_ns = now_ns
        else:
            self._advance(self._readings, now_ns)
        self._readings = self._sensors.sample(measured_values(self._truth))
        self._ticks += 1
        values = interface.machine_values(
            self._readings,
            self.demand,
            sequence=self.sequence,
            ground_speed=self._ground_speed(self._readings),
        )
        return self._schedule.pack(self._ticks - 1, values)

    def reference_frames(self) -> list[Frame]:
        """The test instrumentation's frames that are due at the last tick, with its stamp."""
        values = interface.reference_values(self._truth)
        return self._reference.pack(self._ticks - 1, values, self._now_ns)

    def _advance(self, readings: Readings, now_ns: int) -> None:
        """Driver, limits and dynamics, from the last sample to now."""
        equipment = self._equipment
        speed = self._ground_speed(readings)
        self._driver = drive(
            self._driver,
            equipment.driver,
            self.scenario.script.at((self._ticks - 1) * TICK_S, step=TICK_S),
            speed=speed,
            articulation_angle=readings.value("articulation_angle"),
            dt=TICK_S,
        )
        request = obey(
            request_of(self.demand, self._abilities),
            self.limits_in_force(now_ns),
            equipment.obedience,
            self._abilities,
            speed=speed,
        )
        request = within_power(request, _wheel_speed(readings), self._abilities.drive_power)
        self._plant.advance(request.commands(), TICK_S)
        self._truth = self._plant.truth()

    def _ground_speed(self, readings: Readings) -> float:
        """Ground speed as the machine knows it: from the mean of its wheels [m/s]."""
        return sum(_wheel_speed(readings)) / 4 * self._equipment.rolling_radius


def _wheel_speed(readings: Readings) -> Four:
    return four(readings.values[WHEEL_SPEED].tolist())
