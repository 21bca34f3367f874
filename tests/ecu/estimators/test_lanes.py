"""Predictions and turns side by side in vectors: the same numbers as one after the other, whatever the machine does."""

import platform
import re

import numba
import numpy as np
import pytest

from bus.machine_code import UNCOUNTED
from ecu.calibration import load_calibration
from ecu.estimators import columns
from ecu.estimators.columns import estimate_columns, present_from
from ecu.estimators.live import LiveEstimator
from ecu.estimators.outlook import CASES, case_in
from ecu.estimators.rows import ESTIMATES
from ecu.estimators.signals import NEVER, Estimates, Inputs
from ecu.estimators.stability import lanes, rollover, turn_lanes
from ecu.estimators.stability.step import rates_of
from ecu.estimators.state import INITIAL
from tests.ecu.estimators.test_estimators import drive

P = load_calibration().parameters
ROWS = 768

pytestmark = pytest.mark.timeout(900)  # the first of them compiles


def violent(seed):
    """A drive whose rows are thrown about one by one: levers, hard steering, slopes, loads beyond those of any machine."""
    rng = np.random.default_rng(seed)
    table, names = drive(ROWS, seed), Inputs._fields
    for name in names:
        if not name.endswith(("usable", "limit")) and name != "dt":
            column = names.index(name)
            size = np.abs(table[:, column]).max()
            thrown = rng.random(ROWS) < 0.2
            table[thrown, column] += rng.standard_normal(thrown.sum()) * size
    # levers at rest in a third of the rows
    for name, size in {"articulation_rate_demand": 0.8, "lift_demand": 1.0, "tilt_demand": 1.0}.items():
        table[:, names.index(name)] = size * rng.uniform(-1, 1, ROWS) * (rng.random(ROWS) < 0.67)
    # a bank on which no turn is permitted at any speed
    table[-ROWS // 8 :, names.index("roll")] += 0.6
    for name in ("lift_up_limit", "lift_down_limit", "tilt_back_limit", "tilt_forward_limit"):
        table[:, names.index(name)] = 1.0
    return table


def test_side_by_side_gives_the_bits_of_one_by_one(monkeypatch):
    """Rates, levers and speeds that are permitted in full, in part and not at all; wheels that lift, and none that does."""
    monkeypatch.setattr(columns, "BLOCK", 128)
    table = np.vstack([violent(seed) for seed in (1, 2)])
    live = LiveEstimator(P, "corrected")
    expected = np.array([live.estimate(Inputs(*row.tolist())) for row in table])
    for cores in (1, 2):
        np.testing.assert_array_equal(estimate_columns(table, P, cores=cores), expected)
    found = Estimates(*expected.T)
    for permitted, largest in (
        (found.permitted_rate, P.prediction.largest_rate),
        (found.permitted_speed, None),
    ):
        most = permitted.max() if largest is None else largest
        assert (permitted == 0.0).any()
        assert (permitted == most).any()
        assert ((permitted > 0.0) & (permitted < most)).any()
    assert len(np.unique(found.permitted_lever)) > 8
    assert (found.time_to_lift_off == NEVER).any()
    assert len(np.unique(found.time_to_lift_off)) > 8
    assert len(np.unique(found.lifting_wheel)) == 4


def test_a_division_by_zero_in_a_lane_is_raised(monkeypatch):
    """A cushion of no time divides by zero in every step of a prediction; a vector gives infinity, which a bound would hide."""
    monkeypatch.setattr(columns, "BLOCK", 128)
    stiff = P._replace(prediction=P.prediction._replace(cushion=0.0))
    # a machine that stands and is to turn on: no limit is searched for, which would be done one by one
    table, names = np.tile(drive(1, 3), (ROWS, 1)), Inputs._fields
    for name in names:
        if name.startswith(("wheel_speed", "wheel_torque", "specific_force_x", "specific_force_y")):
            table[:, names.index(name)] = 0.0
        if name in ("yaw_rate", "roll_rate", "pitch_rate", "roll", "pitch", "articulation_rate"):
            table[:, names.index(name)] = 0.0
    table[:, names.index("articulation_angle")] = table[:, names.index("articulation_rate_demand")] = 0.1
    full = Estimates(*estimate_columns(table, P, cores=1).T)
    assert (full.permitted_rate == P.prediction.largest_rate).all()
    for rows in (table[:4], table):  # one by one, and side by side
        with pytest.raises(ZeroDivisionError):
            estimate_columns(rows, stiff, cores=1)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="counts instructions of x86-64")
def test_lanes_are_computed_in_vectors():
    """A loop over a lane's numbers within the loop over lanes is enough to keep LLVM from it, and nothing but the time shows it."""
    state, cases = np.array(INITIAL), np.empty((1, CASES))
    present_from(drive(1, 3), P, state, cases, np.empty((1, ESTIMATES)))
    machine = loaded_machine_of(cases, P)
    rates = rates_of(machine.prediction, machine.drive)
    room = np.zeros(max(lanes.FIELDS * lanes.LANES, turn_lanes.FIELDS * turn_lanes.LANES))
    for function, arguments in (
        (lanes.run_resting, (room, lanes.LANES, 31, 0.5, 0.0, machine, rates)),
        (lanes.run_moving, (room, lanes.LANES, 31, 0.5, 0.0, machine, rates)),
        (turn_lanes.judge, (room, turn_lanes.LANES, machine)),
    ):
        fresh = numba.njit(error_model="numpy", **UNCOUNTED)(function.py_func)
        fresh.compile(tuple(map(numba.typeof, arguments)))
        (code,) = fresh.inspect_asm().values()
        together, alone = (len(re.findall(rf"\bv?{name}\b", code)) for name in ("divpd", "divsd"))
        # what is left of the lanes is computed one by one, by as many instructions again
        assert together >= 0.8 * alone > 0, function.py_func.__name__


@numba.njit
def loaded_machine_of(cases, p):
    """The machine of a case; Python would leave its numbers of several types."""
    by = case_in(cases[0]).loading
    return rollover.loaded_machine(by.front, by.payload, p)
