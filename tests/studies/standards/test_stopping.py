"""Stopping distances against the work of the brakes and the limits of friction."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hil.verdict import Result
from studies.standards import stopping
from studies.standards.stopping import (
    KMH,
    full_brakes,
    iso_secondary,
    iso_service,
    mine_service,
    perform,
    stop,
)

G = 9.81


@pytest.mark.parametrize("share_of_load", [0.0, 1.0])
@pytest.mark.parametrize("kmh", [10.0, 28.0, 35.0])
def test_the_distance_is_that_of_constant_torque_after_the_brakes_lag(candidate, share_of_load, kmh):
    """v lag - a lag²/2 while the torque builds up, and v²/2a; 40 % of the brakes lock no wheel.

    1.5 %: slip, and the rolling radius, which falls with the load and is taken as the equipment's for all wheels.
    """
    machine, v, share, radius = candidate.machine, kmh * KMH, 0.4, candidate.equipment.rolling_radius
    payload = share_of_load * candidate.rated_payload
    mass = machine.mass + payload + 4.0 * machine.wheel.spin_inertia / radius**2
    deceleration, lag = share * sum(full_brakes(candidate)) / radius / mass, machine.brake.time_constant
    expected = v * lag - deceleration * lag**2 / 2.0 + v**2 / (2.0 * deceleration)
    assert stop(candidate, v, payload, (share,) * 4).distance_m == pytest.approx(expected, rel=0.015)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_locked_wheels_stop_by_friction_alone(l60, friction):
    """Between the peak and the sliding end of the tyres' curve: v²/(2 mu g) with either."""
    v = 20.0 * KMH
    tyre = l60.machine.tyre
    share = friction / tyre.nominal_friction
    sliding = share * tyre.pdx1 * math.sin(tyre.pcx1 * math.pi / 2.0)  # far beyond the peak
    least, most = v**2 / (2.0 * share * 1.05 * tyre.pdx1 * G), v**2 / (2.0 * 0.95 * sliding * G)
    assert least < stop(l60, v, 0.0, friction=friction).distance_m < most


def test_a_machine_without_brakes_does_not_stop_and_is_not_passed(l60):
    done = stop(l60, 5.0, 0.0, working=(0.0,) * 4)
    assert math.isnan(done.distance_m)
    check = stopping.check_of("none", done, 10.0, stopping.ISO)
    assert check.result is Result.INCONCLUSIVE


def test_the_way_is_the_integral_of_the_speed(l60):
    done = stop(l60, 28.0 * KMH, 0.0)
    assert np.trapezoid(done.speed, done.time_s) == pytest.approx(done.distance_m, rel=2e-3)


def test_the_mines_formula_makes_the_printed_table():
    """Table M-1, lightest class, 10 to 20 miles per hour, the operator's second included; printed up to a foot longer."""
    printed = np.array((34, 38, 43, 48, 53, 59, 64, 70, 76, 83, 89))
    speeds = np.arange(10, 21) * 0.44704
    feet = np.array([mine_service(v) + v * 1.0 for v in speeds]) / 0.3048
    assert np.all(feet <= printed)
    np.testing.assert_allclose(feet, printed, rtol=0, atol=1.01)


def test_the_iso_limits_at_the_speeds_of_the_sheet():
    """machine sheet: 28 km/h 11.8 and 23.7 m, 35 km/h 16.2 and 32.3 m."""
    found = [(round(iso_service(v), 1), round(iso_secondary(v), 1)) for v in (28.0, 35.0)]
    assert found == [(11.8, 23.7), (16.2, 32.3)]


def test_weak_brakes_fail(l60):
    weak = replace(
        l60,
        equipment=replace(
            l60.equipment,
            actuators=replace(l60.equipment.actuators, service_brake=(4e3,) * 4),
        ),
    )
    results = {check.what: check.result for check in perform(weak).checks}
    assert results["service brakes, empty, 35 km/h"] is Result.FAILED
    assert {check.result for check in perform(l60).checks} == {Result.PASSED}
