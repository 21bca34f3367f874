"""Slip behind the lag of a carcass: a steady slip stays, a small step decays over stiffness times compliance, a large one comes back faster."""

import numpy as np
import pytest

from bench.identify_coverage import any_machine
from identify.field.chain import processed
from identify.field.fit import COMPLIANCE, fit_points
from identify.field.lag import COMPLIANCES, behind_carcass
from identify.make.field import make_field
from identify.tyre.parameters import Nominal, curve, vector

STEP = 0.005  # [s]
SPEED = np.full(2000, 2.0)  # [m/s]
CURVE = curve(
    vector({"PCX1": 1.4, "PDX1": 0.8, "PEX1": 0.0, "PKX1": 8.0}),
    Nominal(load=27e3, pressure=3.5e5, radius=0.74),
    27e3,
    3.5e5,
)[0]


def test_a_steady_slip_does_not_lag():
    slip = np.full(SPEED.size, 0.07)
    assert behind_carcass(CURVE, slip, SPEED, STEP) == pytest.approx(
        np.broadcast_to(slip, (COMPLIANCES.size, SPEED.size)), abs=1e-12
    )


def test_a_small_step_decays_over_slip_stiffness_times_compliance():
    slip = np.where(np.arange(SPEED.size) < 400, 0.0, 1e-4)
    behind = behind_carcass(CURVE, slip, SPEED, STEP)
    at = 600
    travelled = (at - 400 + 0.5) * STEP * SPEED[0]  # the slip between two samples is their mean
    # dF/dkappa of the Magic Formula at no slip is PKX1 times the load
    wanted = 1e-4 * (1.0 - np.exp(-travelled / (8.0 * 27e3 * COMPLIANCES)))
    assert behind[:, at] == pytest.approx(wanted, rel=1e-3)


def test_the_wheel_comes_back_from_a_large_slip_faster_than_from_a_small_one():
    def left(size: float) -> float:
        slip = np.where(np.arange(SPEED.size) < 400, size, 0.0)
        soft = behind_carcass(CURVE, slip, SPEED, STEP)[6]
        return float(soft[460]) / size

    assert left(0.6) < 0.5 * left(0.001)


def test_a_soft_carcass_is_identified_and_leaves_the_tyre_in_its_intervals():
    machine = any_machine(35)  # 0.46 MN/m: a relaxation length of one metre at the heaviest load
    log, truth = make_field(machine, 35)
    _, found = fit_points(processed(log))
    for name in ("PCX1", "PDX1", "PEX1", "PKX1", "PDX2"):
        i = found.interval(name)
        assert abs(i.value - truth.tyre[name]) < 2.5 * i.sd
    compliance = found.interval(COMPLIANCE)
    assert compliance.value == pytest.approx(1.0 / machine.tyre.longitudinal_stiffness, rel=0.1)
