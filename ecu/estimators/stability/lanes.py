"""Predictions of many machines at once, side by side in the lanes of vectors.

One prediction follows another in no way, and a step of one waits for its own divisions most of the time. So the steps of `LANES`
machines are computed in one loop, whose body is the same text as of `prediction.predict` and without a branch that a lane takes alone.
The operations of a lane and their order stay, and so do the results, bit by bit (ADR 81).

A lane whose margin has fallen so low that its prediction ends keeps its result, while its machine runs on with the others.
"""

from typing import Any

import numpy as np

from ecu.estimators.compiled import compiled, inlined, side_by_side
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.motion.arm import Turning
from ecu.estimators.parameters import Body
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.signals import NEVER
from ecu.estimators.stability.levers import Levers, moved
from ecu.estimators.stability.loading import Loading, divides, reloaded
from ecu.estimators.stability.prediction import OVERTURNED, Prediction, predict, predicted, steps_of
from ecu.estimators.stability.rocking import RestoringMatrix, Rocking, restoring_matrix
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.step import (
    Course,
    PredictionState,
    Rates,
    course_from,
    loaded,
    moved_on,
    rates_of,
)

LANES = 32
"""Machines in one loop: enough to hide the divisions, few enough for the nearest cache (18 kB)."""
FIELDS = 72
"""Numbers of a lane: course 0 to 32, result 33 to 41, what does not change 42 to 71. Field f of lane j is at f * LANES + j."""

Lanes = Any  # NDArray[np.float64], shape (FIELDS * LANES,)


@inlined
def joint_in(v: Lanes, field: int, j: int) -> Joint:
    """A joint of a lane."""
    return Joint(v[field * LANES + j], v[(field + 1) * LANES + j], v[(field + 2) * LANES + j])


@inlined
def put_joint(v: Lanes, field: int, j: int, joint: Joint) -> None:
    """Its counterpart."""
    v[field * LANES + j] = joint.angle
    v[(field + 1) * LANES + j] = joint.cosine
    v[(field + 2) * LANES + j] = joint.sine


@inlined
def part_in(v: Lanes, field: int, j: int) -> Turning:
    """Motion of arm or bucket; a prediction has no samples."""
    return Turning(v[field * LANES + j], v[(field + 1) * LANES + j], v[(field + 2) * LANES + j], 0.0)


@inlined
def put_part(v: Lanes, field: int, j: int, part: Turning) -> None:
    """Its counterpart."""
    v[field * LANES + j] = part.angle
    v[(field + 1) * LANES + j] = part.rate
    v[(field + 2) * LANES + j] = part.acceleration


@inlined
def rocking_in(v: Lanes, j: int) -> Rocking:
    """How the machine of a lane rocks."""
    return Rocking(
        v[12 * LANES + j], v[13 * LANES + j], v[14 * LANES + j], v[15 * LANES + j], v[16 * LANES + j],
        v[17 * LANES + j], v[18 * LANES + j], v[19 * LANES + j], v[20 * LANES + j],
    )  # fmt: skip


@inlined
def course_in(v: Lanes, j: int, standing: NormalForces) -> Course:
    """The machine of a lane; the least margin so far, and forces that no step reads."""
    return Course(
        joint_in(v, 0, j), v[3 * LANES + j], v[4 * LANES + j], v[5 * LANES + j], v[6 * LANES + j], v[7 * LANES + j],
        v[8 * LANES + j], v[9 * LANES + j], v[10 * LANES + j], v[11 * LANES + j], rocking_in(v, j),
        part_in(v, 21, j), part_in(v, 24, j), joint_in(v, 27, j), joint_in(v, 30, j),
        standing, v[38 * LANES + j], v[39 * LANES + j],
    )  # fmt: skip


@inlined
def put_course(v: Lanes, j: int, c: Course, arm_moves: bool) -> None:
    """The machine into a lane; arm and bucket only where they move."""
    put_joint(v, 0, j, c.joint)
    v[3 * LANES + j] = c.rate
    v[4 * LANES + j] = c.speed
    v[5 * LANES + j] = c.acceleration
    v[6 * LANES + j] = c.drift
    v[7 * LANES + j] = c.yaw
    v[8 * LANES + j] = c.front_load
    v[9 * LANES + j] = c.rear_load
    v[10 * LANES + j] = c.gravity_x
    v[11 * LANES + j] = c.gravity_y
    # written out: a loop over them within the loop over lanes keeps LLVM from making vectors
    v[12 * LANES + j] = c.rocking.left
    v[13 * LANES + j] = c.rocking.right
    v[14 * LANES + j] = c.rocking.rear
    v[15 * LANES + j] = c.rocking.left_rate
    v[16 * LANES + j] = c.rocking.right_rate
    v[17 * LANES + j] = c.rocking.rear_rate
    v[18 * LANES + j] = c.rocking.left_load
    v[19 * LANES + j] = c.rocking.right_load
    v[20 * LANES + j] = c.rocking.pivot_load
    if arm_moves:
        put_part(v, 21, j, c.lift)
        put_part(v, 24, j, c.tilt)
        put_joint(v, 27, j, c.pivot)
        put_joint(v, 30, j, c.pin)


@inlined
def put_result(v: Lanes, j: int, c: Course, now: float, end: float) -> None:
    """What a lane's prediction has found, unless it has ended; now: time of this step [s]; end: margin at which it ends."""
    ended = v[41 * LANES + j] != 0.0
    v[33 * LANES + j] = v[33 * LANES + j] if ended else c.forces.front_left
    v[34 * LANES + j] = v[34 * LANES + j] if ended else c.forces.front_right
    v[35 * LANES + j] = v[35 * LANES + j] if ended else c.forces.pivot
    v[36 * LANES + j] = v[36 * LANES + j] if ended else c.forces.rear_left
    v[37 * LANES + j] = v[37 * LANES + j] if ended else c.forces.rear_right
    v[38 * LANES + j] = v[38 * LANES + j] if ended else c.worst
    v[39 * LANES + j] = v[39 * LANES + j] if ended else c.lifting
    ends = c.worst <= end
    v[40 * LANES + j] = now if ends and not ended and c.worst <= 0.0 else v[40 * LANES + j]
    v[41 * LANES + j] = 1.0 if ends else v[41 * LANES + j]


@inlined
def start_in(v: Lanes, j: int) -> PredictionState:
    """What every step needs of where a prediction starts; the rest is 0."""
    return PredictionState(
        0.0, 0.0, v[42 * LANES + j], 0.0, 0.0, 0.0, 0.0, v[43 * LANES + j], Vector(0.0, 0.0, 0.0), 0.0, 0.0,
        v[44 * LANES + j], v[45 * LANES + j], v[46 * LANES + j], v[47 * LANES + j], v[48 * LANES + j],
        Levers(0.0, 0.0, v[49 * LANES + j], 0.0, 0.0, v[50 * LANES + j]),
    )  # fmt: skip


@inlined
def loading_in(v: Lanes, j: int) -> Loading:
    """How the machine of a lane is loaded. No step asks for its pitch frequency."""
    return Loading(
        Body(
            v[51 * LANES + j], v[52 * LANES + j], v[53 * LANES + j], v[54 * LANES + j], v[55 * LANES + j],
            v[56 * LANES + j],
        ),
        NormalForces(
            v[57 * LANES + j], v[58 * LANES + j], 0.0, v[59 * LANES + j], v[60 * LANES + j]
        ),
        0.0, v[61 * LANES + j],
    )  # fmt: skip


@inlined
def restoring_in(v: Lanes, j: int) -> RestoringMatrix:
    """The restoring of the tyres of a lane's machine."""
    return RestoringMatrix(
        v[62 * LANES + j], v[63 * LANES + j], v[64 * LANES + j], v[65 * LANES + j], v[66 * LANES + j],
        v[67 * LANES + j], v[68 * LANES + j], v[69 * LANES + j], v[70 * LANES + j], v[71 * LANES + j],
    )  # fmt: skip


@inlined
def put_given(v: Lanes, j: int, s: PredictionState, by: Loading, m: LoadedMachine) -> None:
    """What does not change within a prediction, and a result that nothing has found yet."""
    put_course(v, j, course_from(s, by.standing, m.bucket.carried), True)
    v[38 * LANES + j] = 1e9
    v[39 * LANES + j] = 0.0
    v[40 * LANES + j] = NEVER
    v[41 * LANES + j] = 0.0
    given = (
        s.demanded_rate, s.gravity_z, s.front_left, s.front_right, s.rear_load, s.left_rate, s.right_rate,
        s.levers.lift_demand, s.levers.tilt_demand, by.front.mass, by.front.x, by.front.z, by.front.roll_inertia,
        by.front.pitch_inertia, by.front.yaw_inertia, by.standing.front_left, by.standing.front_right,
        by.standing.rear_left, by.standing.rear_right, by.payload,
    )  # fmt: skip
    for k in range(len(given)):
        v[(42 + k) * LANES + j] = given[k]
    restoring = restoring_matrix(joint_at(s.articulation_angle), reloaded(m, by))
    for k in range(len(restoring)):
        v[(62 + k) * LANES + j] = restoring[k]


@inlined
def step_lanes(
    v: Lanes,
    n: int,
    first: bool,
    held: bool,
    arm_moves: bool,
    now: float,
    end: float,
    m: LoadedMachine,
    r: Rates,
) -> None:
    """One step of n lanes."""
    for j in range(n):
        machine = reloaded(m, loading_in(v, j))
        c = loaded(
            course_in(v, j, machine.standing),
            first,
            held,
            arm_moves,
            start_in(v, j),
            restoring_in(v, j),
            r,
            machine,
        )
        put_result(v, j, c, now, end)
        put_course(v, j, moved_on(c, r, m.geometry.articulation_stop), arm_moves)


# Two functions, so that the machine code of each is without the other's branches.
@side_by_side
def run_resting(v: Lanes, n: int, steps: int, hold: float, end: float, m: LoadedMachine, r: Rates) -> None:
    """n lanes in which neither arm nor bucket moves, to their end."""
    step_lanes(v, n, True, True, False, 0.0, end, m, r)
    for k in range(1, steps):
        step_lanes(v, n, False, k * r.step < hold, False, k * r.step, end, m, r)


@side_by_side
def run_moving(v: Lanes, n: int, steps: int, hold: float, end: float, m: LoadedMachine, r: Rates) -> None:
    """n lanes in which arm or bucket moves, to their end."""
    step_lanes(v, n, True, True, True, 0.0, end, m, r)
    for k in range(1, steps):
        step_lanes(v, n, False, k * r.step < hold, True, k * r.step, end, m, r)


@compiled
def is_finite(v: Lanes, j: int) -> bool:
    """Whether no division by zero has come into a lane: what it gives stays in drift, yaw and loads."""
    total = 0.0
    for f in range(FIELDS):
        total += v[f * LANES + j] * 0.0
    return total == 0.0


@compiled
def predict_chosen(
    chosen: Any, starts: Any, loadings: Any, hold: float, floor: float, m: LoadedMachine, found: Any
) -> None:
    """The chosen of many predictions of one machine, each as `predict` gives it, into `found`. Errors as there.

    chosen: bools; starts, loadings, found: lists of PredictionState, Loading and Prediction.
    """
    rates, end, steps = rates_of(m.prediction, m.drive), max(floor, OVERTURNED), steps_of(m)
    v, rows = np.empty(FIELDS * LANES), np.empty(LANES, np.int64)
    for arm_moves in (False, True):
        n = 0
        for k in range(len(starts)):
            if chosen[k] and moved(starts[k].levers) == arm_moves:
                put_given(v, n, starts[k], loadings[k], m)
                rows[n] = k
                n += 1
            if n == LANES or (k == len(starts) - 1 and n > 0):
                if arm_moves:
                    run_moving(v, n, steps, hold, end, m, rates)
                else:
                    run_resting(v, n, steps, hold, end, m, rates)
                for j in range(n):
                    row = rows[j]
                    if is_finite(v, j) and divides(m, loadings[row]):
                        found[row] = result_in(v, j)
                    else:  # perhaps by zero: `predict` says whether
                        found[row] = predict(starts[row], hold, floor, reloaded(m, loadings[row]))
                n = 0


@inlined
def result_in(v: Lanes, j: int) -> Prediction:
    """What a lane's prediction has found."""
    forces = NormalForces(
        v[33 * LANES + j], v[34 * LANES + j], v[35 * LANES + j], v[36 * LANES + j], v[37 * LANES + j]
    )
    return predicted(course_in(v, j, forces), v[40 * LANES + j])
