"""The plant: one machine on one road, advanced in fixed steps by compiled code.

Valid until the body itself would touch the ground (a lean of about 60 degrees): only tyres have contact with the ground.
"""

import math
from dataclasses import dataclass, fields
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from bus.machine_code import direct
from plant.effects import dispatch
from plant.observer import Observer, advance_and_observe
from plant.physics import state as s
from plant.physics.equilibrium import find_equilibrium
from plant.physics.parameters import P_BRAKE_CAPACITY, P_NORMAL, parameter_vector
from plant.physics.rolling import roll_steadily
from plant.physics.surface import Surface, road_axes
from plant.physics.workspace import Workspace, new_workspace
from plant.sheets.machine import Machine
from plant.truth import Truth

Array = NDArray[np.float64]
Integrator = Literal["semi-implicit", "rk4"]

RESTS = 60  # iterations between the equilibrium of the machine and the states of its effects

_STILL = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Commands:
    """Commands to the machine; the machine limits them to its own abilities.

    wheel_torque: demanded drive torque at each wheel [N m]; brake_torque: available friction torque
    of each wheel, not negative [N m]; rates [rad/s]: articulation left, lift up, tilt back positive.
    """

    wheel_torque: tuple[float, float, float, float] = _STILL
    brake_torque: tuple[float, float, float, float] = _STILL
    articulation_rate: float = 0.0
    lift_rate: float = 0.0
    tilt_rate: float = 0.0

    def __post_init__(self) -> None:
        numbers = self._numbers()
        # one sum for all at 100 Hz: only what is not finite, or far beyond any machine, gives a sum that is not finite
        if not math.isfinite(sum(numbers)) and not all(map(math.isfinite, numbers)):
            raise ValueError(
                "; ".join(
                    f"Commands.{item.name}={getattr(self, item.name)} is not finite"
                    for item in fields(self)
                    if not np.isfinite(getattr(self, item.name)).all()
                )
            )
        if min(self.brake_torque) < 0.0:
            raise ValueError(
                f"Commands.brake_torque={self.brake_torque} N m: a friction torque cannot be negative"
            )

    def _numbers(self) -> tuple[float, ...]:
        rates = (self.articulation_rate, self.lift_rate, self.tilt_rate)
        return *self.wheel_torque, *self.brake_torque, *rates

    def vector(self) -> NDArray[np.float64]:
        """The command vector of the compiled dynamics: torques of four wheels and of their brakes, rates."""
        return np.array(self._numbers())

    @classmethod
    def of(cls, vector: NDArray[np.float64]) -> Self:
        """The commands of such a vector."""
        a, b, c, d, i, j, k, m, articulation, lift, tilt = vector.tolist()
        return cls(
            wheel_torque=(a, b, c, d),
            brake_torque=(i, j, k, m),
            articulation_rate=articulation,
            lift_rate=lift,
            tilt_rate=tilt,
        )


class DivergedError(RuntimeError):
    """The motion left the range of numbers: a parameter or a step is impossible."""


def steps_in(duration_s: float, step_s: float) -> int:
    """How many steps a duration has. Errors: ValueError where that is no whole number."""
    count = round(duration_s / step_s)
    # the relative part: a duration that is the difference of two long times carries their rounding
    if count < 0 or abs(count * step_s - duration_s) > 1e-6 * step_s + 1e-12 * abs(duration_s):
        raise ValueError(f"duration_s={duration_s} s is not a whole number of steps of {step_s} s")
    return count


class Plant:
    """A loader in motion.

    Starts at the world's origin, at rest on its deflected tyres, or at `speed` [m/s] of the rear axle in a steady
    turn with its articulation angle: tyres carry the lateral forces of turn and slope, wheels have no torque. A standing
    machine starts with its brakes applied; they follow the commands from the first step on.
    Angles in rad; lift arm and tilt default to the carry position. heading is about the road's normal.
    """

    def __init__(
        self,
        machine: Machine,
        surface: Surface | None = None,
        *,
        payload_mass: float = 0.0,
        speed: float = 0.0,
        articulation_angle: float = 0.0,
        lift_arm_angle: float | None = None,
        tilt_angle: float | None = None,
        heading: float = 0.0,
        step_s: float = 1e-3,
        integrator: Integrator = "semi-implicit",
    ) -> None:
        lift = machine.lift.carry_angle if lift_arm_angle is None else lift_arm_angle
        tilt = machine.tilt.carry_angle if tilt_angle is None else tilt_angle
        _check_range("payload_mass", payload_mass, "kg", 0.0, 10.0 * machine.payload.reference_mass)
        _check_range("speed", speed, "m/s", -30.0, 30.0)
        _check_range(
            "articulation_angle", articulation_angle, "rad", -machine.steering.limit, machine.steering.limit
        )
        _check_range("lift_arm_angle", lift, "rad", machine.lift.lower_limit, machine.lift.upper_limit)
        _check_range("tilt_angle", tilt, "rad", machine.tilt.lower_limit, machine.tilt.upper_limit)
        _check_range("step_s", step_s, "s", 1e-6, 5e-3)
        if integrator not in ("semi-implicit", "rk4"):
            raise ValueError(f"integrator={integrator!r} is neither 'semi-implicit' nor 'rk4'")
        self.machine = machine
        self.surface = Surface() if surface is None else surface
        self.payload_mass = payload_mass
        self.step_s = float(step_s)
        self.integrator = integrator
        self._steps = 0
        self._parameters = parameter_vector(machine, self.surface, payload_mass)
        self._active = dispatch.active_vector(machine.effects)
        self._observer = Observer(machine, payload_mass)
        self._work = new_workspace()
        self._command = np.zeros(s.COMMANDS)
        self._state = np.zeros(s.STATES)
        self._state[s.JOINT + s.FRONT_FRAME] = articulation_angle
        self._state[s.JOINT + s.LIFT_ARM] = lift
        self._state[s.JOINT + s.BUCKET] = tilt
        self._start(speed, heading)
        # last: where it is the first that numba compiles, with all that it calls, it takes four times as long and seven times the room
        self._advance_and_observe = direct(advance_and_observe, *self._arguments(1, np.empty(Truth.size)))

    @property
    def time_s(self) -> float:
        """Time since the start [s]."""
        return self._steps * self.step_s

    def advance(self, commands: Commands, duration_s: float) -> Truth:
        """Move on by `duration_s`, a whole number of steps, with constant commands; returns everything that is true then."""
        return self.advance_by(commands.vector(), duration_s)

    def advance_by(self, command: Array, duration_s: float) -> Truth:
        """The same for finite commands in the order of `Commands.vector`, which are not looked at again."""
        count = steps_in(duration_s, self.step_s)
        self._command[:] = command
        row = np.empty(Truth.size)
        finite = self._advance_and_observe(*self._arguments(count, row))
        self._steps += count
        if not finite:
            raise DivergedError(
                f"the motion diverged before {self.time_s:.3f} s (step {self.step_s} s): "
                "is a stiffness or damping too large for the step, or an inertia too small?"
            )
        return self._observer.finished(row, self.time_s)

    def _arguments(
        self, count: int, row: Array
    ) -> tuple[Array, Array, Array, float, int, bool, Workspace, Array | None, Array, Array]:
        """Of `advance_and_observe`, for so many steps and the row to fill."""
        return (
            self._state,
            self._command,
            self._parameters,
            self.step_s,
            count,
            self.integrator == "rk4",
            self._work,
            self._active,
            row,
            self._observer.measures,
        )

    def truth(self) -> Truth:
        """Everything that is true now."""
        return self._observer.truth(
            self.time_s, self._state, self._command, self._parameters, self._work, self._active
        )

    def inside(self) -> tuple[Array, Array, Workspace, Array | None, Array]:
        """Copies of state and parameters, a workspace, the active effects and what the record needs of the machine."""
        return (
            self._state.copy(),
            self._parameters.copy(),
            new_workspace(),
            self._active,
            self._observer.measures,
        )

    def copy(self) -> Self:
        """An independent plant in the same state."""
        # without __init__, which would look for the equilibrium anew; what is not copied is never written to
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)
        twin._parameters = self._parameters.copy()
        twin._work = new_workspace()
        twin._command = self._command.copy()
        twin._state = self._state.copy()
        return twin

    def _start(self, speed: float, heading: float) -> None:
        state, work = self._state, self._work
        standing = speed == 0.0
        road = road_axes(self._parameters[P_NORMAL : P_NORMAL + 3])
        dispatch.start(self.machine.effects, state, self._parameters, work)
        for _ in range(RESTS):
            find_equilibrium(
                state, self._parameters, work, self._active, road, heading=heading, standing=standing
            )
            if not dispatch.start(self.machine.effects, state, self._parameters, work):
                break
        if standing:
            # otherwise a machine on a slope would roll while the brakes build up their torque
            state[s.BRAKE : s.BRAKE + 4] = self._parameters[P_BRAKE_CAPACITY]
            self._command[s.C_BRAKE : s.C_BRAKE + 4] = self._parameters[P_BRAKE_CAPACITY]
        else:
            geometry = self.machine.geometry
            axles = (-geometry.rear_axle_x, geometry.front_axle_x)
            roll_steadily(state, self._parameters, work, self._active, road, heading, speed, axles)


def _check_range(name: str, value: float, unit: str, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name}={value} {unit} is outside {low:.4g}..{high:.4g} {unit}")
