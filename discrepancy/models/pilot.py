"""The machine that is led through what comes before a stretch, so that the stretch begins in the midst of its motion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from discrepancy.models.shared_out import Way, led, parameters_of
from discrepancy.recording import Array
from plant import state as s
from plant.follow import M_ARTICULATION, M_LIFT, M_SPEED, M_TILT
from plant.machine import Machine
from plant.parameters import P_NORMAL
from plant.plant import Plant
from plant.resting import REST, height, set_height

PILOT_S: Final = 2.5e-3  # its step
RUN_IN_S: Final = 15.0  # before a stretch: swings die away within a second or two, errors of speed within six
ROLLED: Final = 0.98  # of its radius, that a wheel rolls on
STANDING: Final = 0.02  # wheel speed [rad/s] below which a stretch begins at a standstill


def flown(
    machine: Machine,
    values: Mapping[str, float],
    whole: Way,
    rows: Sequence[int],
    begun: dict[int, Array],
    turning: Array | None = None,
) -> Array:
    """States (n, STATES) of a machine at some rows of a whole recording.

    values: as in `led`; turning: yaw rate of the rear frame (rows of the recording,) [rad/s], if it was measured. Effects with states of their own
    remember all that was before them; else a run-in will do, and any machine's rest to begin it from: begun keeps them by row, and may be shared
    by threads. At the first row it has to be the machine's own. Raises NoEquilibriumError.
    """
    remembers = any(item.effect.own_states for item in machine.effects)
    flights = _flights(rows, len(whole.measured) if remembers else round(RUN_IN_S / whole.step_s))
    edges = np.cumsum([0, *(len(flight) for flight in flights)]).astype(np.intp)
    taken = np.concatenate([np.arange(flight.start, flight.stop) for flight in flights])
    way = replace(
        whole,
        measured=whole.measured[taken],
        speeds={name: speed[taken] for name, speed in whole.speeds.items()},
        edges=edges,
    )
    rests = [_rest(machine, whole, flight.start, begun) for flight in flights]
    places, p = reckoned(machine, whole.measured, whole.step_s, turning), parameters_of(machine, way, PILOT_S)
    starts = np.stack(
        [_placed(rest, places[flight.start], p) for rest, flight in zip(rests, flights, strict=True)]
    )
    states = led(machine, values, way, starts, np.zeros((0, REST)), PILOT_S, states=True)
    arrived = states[np.searchsorted(taken, rows)]
    if turning is not None:
        # what a machine misses of the road turns it otherwise: it points where the gyro says
        for state, row in zip(arrived, rows, strict=True):
            _turn(state, places[row, 2] - _heading(state), p)
    return np.asarray(arrived, float)


def _rest(machine: Machine, whole: Way, row: int, begun: dict[int, Array]) -> Array:
    if row in begun:
        return begun[row]
    state = at_begin(machine, whole.payload, whole.measured[row]).inside()[0]
    if row > 0:
        begun[row] = state
    return state


def _flights(rows: Sequence[int], run_in: int) -> list[range]:
    """What is flown to come to each row after `run_in` others, or from the first one; flights that meet are one."""
    flights: list[range] = []
    for row in sorted(rows):
        first = max(row - run_in, 0)
        if flights and first <= flights[-1].stop:
            first = flights.pop().start
        flights.append(range(first, row + 1))
    return flights


def reckoned(machine: Machine, measured: Array, step_s: float, turning: Array | None = None) -> Array:
    """Dead reckoning of the joint from the first row on: along and across [m], heading of the rear frame [rad] (n, 3).

    measured: (n, MEASURED). Where the yaw rate was not measured it is that of axles that do not slip sideways. What a road's slope or a
    place on it does must be the same wherever a run-in begins.
    """
    speed, angle = ROLLED * machine.tyre.radius * measured[:, M_SPEED], measured[:, M_ARTICULATION]
    ahead, behind = machine.geometry.front_axle_x, -machine.geometry.rear_axle_x
    if turning is None:
        bending = ahead * np.gradient(angle, step_s)
        turning = (speed * np.sin(angle) - bending) / (ahead + behind * np.cos(angle))
    heading = cumulative_trapezoid(turning, dx=step_s, initial=0)
    sideways = behind * turning
    along = speed * np.cos(heading) - sideways * np.sin(heading)
    across = speed * np.sin(heading) + sideways * np.cos(heading)
    place = cumulative_trapezoid([along, across], dx=step_s, initial=0)
    return np.stack([*place, heading], axis=1)


def _placed(state: Array, place: Array, p: Array) -> Array:
    """A state at the origin with heading 0 moved along the road of parameters p to a place (along, across, heading)."""
    moved, above = state.copy(), height(state, p)
    _turn(moved, place[2], p)
    moved[s.POSITION : s.POSITION + 2] += place[:2]
    set_height(moved, p, above)
    return moved


def _turn(state: Array, angle: float, p: Array) -> None:
    """Turn a machine and its motion about the normal of the road of parameters p, in place [rad]."""
    turn = Rotation.from_rotvec(angle * p[P_NORMAL : P_NORMAL + 3])
    state[s.ATTITUDE : s.ATTITUDE + 4] = (turn * _attitude(state)).as_quat(scalar_first=True)
    state[s.VELOCITY : s.VELOCITY + 3] = turn.apply(state[s.VELOCITY : s.VELOCITY + 3])


def _heading(state: Array) -> float:
    return float(_attitude(state).as_euler("ZYX")[0])


def _attitude(state: Array) -> Rotation:
    return Rotation.from_quat(state[s.ATTITUDE : s.ATTITUDE + 4], scalar_first=True)


def at_begin(machine: Machine, payload: float, first: Array) -> Plant:
    """A plant as the first row of what was measured begins: at rest on its tyres, or rolling evenly. Raises NoEquilibriumError."""
    speed = float(first[M_SPEED]) * machine.tyre.radius * ROLLED
    return Plant(
        machine,
        payload_mass=payload,
        speed=speed if abs(first[M_SPEED]) > STANDING else 0.0,
        articulation_angle=_within(first[M_ARTICULATION], -machine.steering.limit, machine.steering.limit),
        lift_arm_angle=_within(first[M_LIFT], machine.lift.lower_limit, machine.lift.upper_limit),
        tilt_angle=_within(first[M_TILT], machine.tilt.lower_limit, machine.tilt.upper_limit),
    )


def _within(value: float, low: float, high: float) -> float:
    return float(min(max(value, low), high))
