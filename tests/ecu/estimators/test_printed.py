"""The printed form: it solves the thesis' equations as printed, and each erratum shows what the print does wrong.

Vectors were computed outside this project by a free-body solve and by hand.
"""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.loads.normal_force import standing
from ecu.estimators.parameters import Body, Geometry
from ecu.estimators.printed import tyre
from ecu.estimators.printed.centre import machine_centre_printed, machine_centre_repaired
from ecu.estimators.printed.normal_force import (
    printed_arms,
    printed_normal_forces,
    printed_normal_forces_literal,
)
from ecu.estimators.printed.straight import inclined_printed
from ecu.estimators.printed.turning import to_rear_axes_printed
from ecu.estimators.quantities import Centre

unhurried = settings(deadline=None)  # the first example compiles
PARAMETERS = load_calibration().parameters
GEOMETRY = Geometry(1.5, 1.5, 1.93, 1.93, 0.90, math.radians(40))
MASS, HEIGHT, AXLE, AXLE_HEIGHT = 11092.0, 1.11071, 750.0, 0.72
FRONT, REAR = Body(4300.0, 1.6442, 1.0, 0, 0, 0), Body(6792.0, -1.20, 1.2, 0, 0, 0)

angles = st.floats(-0.7, 0.7)
forces = st.floats(-5.0, 5.0)


def centre(angle):
    x = (FRONT.mass * FRONT.x * math.cos(angle) + REAR.mass * REAR.x) / MASS
    return Centre(MASS, x, FRONT.mass * FRONT.x * math.sin(angle) / MASS, HEIGHT)


def test_the_printed_model_loses_the_pivot_forces_arm():
    """At 0.3 rad standing: 17 958.6 / 31 685.9 N instead of 24 294.7 / 26 472.7 N (E-15)."""
    arms = printed_arms(centre(0.3), 0.3, GEOMETRY)
    n = printed_normal_forces(MASS, HEIGHT, arms, 0, 0, 0, 0, 9.81, AXLE, AXLE_HEIGHT, 1.93 / 2, 0.9)
    assert n == pytest.approx((17958.6, 31685.9, 59168.0, 33262.7, 33262.7), abs=0.2)


@unhurried
@given(angles, forces, forces, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_the_printed_solution_solves_the_printed_equations(angle, ax, ay, pitch, roll):
    """(71), (79), (80), (82) and (85) with the sign it was solved with."""
    a = printed_arms(centre(angle), angle, GEOMETRY)
    half, zr, g = 1.93 / 2, 0.9, 9.81
    n1, n2, nr, n3, n4 = printed_normal_forces(
        MASS, HEIGHT, a, ax, ay, pitch, roll, g, AXLE, AXLE_HEIGHT, half, zr
    )
    forward, right = ax + g * math.sin(pitch), ay + g * math.sin(roll)
    a1, a2, ar, b1, b2 = a
    scale = MASS * g
    assert n1 + n2 + nr == pytest.approx(MASS * g * math.cos(roll) * math.cos(pitch), abs=1e-9 * scale)
    assert n1 * a1 + n2 * a2 - nr * ar + (HEIGHT - zr / 2) * MASS * forward == pytest.approx(
        0, abs=1e-9 * scale
    )
    assert n1 * b1 - n2 * b2 - (HEIGHT - zr / 2) * MASS * right == pytest.approx(0, abs=1e-9 * scale)
    assert n3 + n4 - nr - AXLE * g * math.cos(roll) == pytest.approx(0, abs=1e-9 * scale)
    assert n3 * half - n4 * half - AXLE_HEIGHT * AXLE * right - zr * MASS * right / 2 == pytest.approx(
        0, abs=1e-9 * scale
    )


def test_the_printed_relaxation_drives_the_slip_the_wrong_way():
    """E-06: its stationary transient slip is minus the slip."""
    assert tyre.contact_point_rate_printed(-0.3 * 0.02, 0.02, 1.0, 0.3) == pytest.approx(0.0, abs=1e-15)


def test_where_no_friction_is_left_the_printed_curve_gives_its_shift():
    """D = 0 at the nominal load: (22) divides by it."""
    m = PARAMETERS.magic_formula._replace(PDx1=0.0, PDx2=0.0, PVx1=0.02, PVx2=0.0)
    for form in (tyre.magic_formula, tyre.magic_formula_printed):
        force = form(0.3, m.nominal_load, m.nominal_pressure, m)
        assert force == pytest.approx(0.02 * m.nominal_load)


@unhurried
@given(st.floats(0.05, 0.99), st.floats(1e3, 1e5), st.floats(-3.0, 0.9))
def test_the_shape_factor_leads_the_curve_to_its_asymptote(share, D, E):
    """(17): at endless slip arctan is pi / 2 for every E below 1."""
    C = tyre.shape_of_asymptote(share * D, D)
    assert 1.0 < C < 2.0
    assert tyre.magic_formula_shape(1e9, 10.0, C, D, E) == pytest.approx(share * D, rel=1e-5)


@unhurried
@given(st.floats(0.05, 0.4), st.floats(8.0, 20.0), st.floats(1.2, 1.9))
def test_the_curvature_puts_the_peak_where_it_is_asked_for(peak, B, C):
    """(20): the force there is D, and no slip gives more."""
    E = tyre.curvature_of_peak(peak, B, C)
    assert tyre.magic_formula_shape(peak, B, C, 1e4, E) == pytest.approx(1e4, rel=1e-9)
    if E < 1.0:  # above it the curve turns over
        for slip in (0.5 * peak, 0.9 * peak, 1.1 * peak, 2.0 * peak):
            assert tyre.magic_formula_shape(slip, B, C, 1e4, E) < 1e4


def test_the_printed_friction_circle_gives_every_wheel_the_whole_weight():
    """E-04: four wheels together could push with four times what the ground gives."""
    alone = tyre.side_force_left_printed(0.0, 0.8, MASS, 9.81)
    assert 4.0 * alone == pytest.approx(4.0 * 0.8 * MASS * 9.81)
    assert math.hypot(tyre.side_force_left_printed(3e4, 0.8, MASS, 9.81), 3e4) == pytest.approx(alone)
    assert tyre.side_force_left_printed(1e6, 0.8, MASS, 9.81) == 0.0


@unhurried
@given(st.floats(0.5, 2.5), st.floats(0.5, 2.5), st.floats(-0.4, 0.4), st.floats(0.3, 1.5))
def test_the_printed_incline_has_the_axles_exchanged(front, rear, grade, height):
    """E-13: weight is kept, but the moments balance only with the distances of the other axle."""
    printed = inclined_printed(1e5, front, rear, grade, height)
    assert 2.0 * sum(printed) == pytest.approx(1e5 * math.cos(grade))
    assert printed == pytest.approx(standing(1e5, rear, front, grade, height))
    moment = 2.0 * (printed[0] * front - printed[1] * rear) + 1e5 * math.sin(grade) * height
    assert moment == pytest.approx(1e5 * math.cos(grade) * (front - rear), abs=1e-6)


@given(forces, forces)
def test_the_printed_rotation_loses_the_lateral_force(x, y):
    """E-26: straight ahead, the front wheels' lateral force goes along."""
    assert to_rear_axes_printed(x, y, 0.0) == pytest.approx((x - y, 0.0), abs=1e-12)


def standing_on(form, pitch, roll):
    """Loads of a straight machine that stands on a slope."""
    arms = printed_arms(centre(0.0), 0.0, GEOMETRY)
    return form(MASS, HEIGHT, arms, 0, 0, pitch, roll, 9.81, AXLE, AXLE_HEIGHT, 1.93 / 2, 0.9)


def test_the_letter_of_the_print_takes_a_grade_for_a_bank():
    """E-14: (88)-(92) interchange pitch and roll."""
    solved = standing_on(printed_normal_forces, 0.1, 0.0)
    literal = standing_on(printed_normal_forces_literal, 0.1, 0.0)
    assert solved.front_left == pytest.approx(solved.front_right)
    assert abs(literal.front_left - literal.front_right) > 0.1 * literal.front_left


def test_the_letter_of_the_print_adds_the_rear_bodys_length_to_the_side():
    """E-10: a straight machine's centre of gravity lies 0.735 m off its middle, (6792 kg 1.20 m) / 11092 kg."""
    assert machine_centre_repaired(0.0, FRONT, REAR).y == pytest.approx(0.0)
    assert machine_centre_printed(0.0, FRONT, REAR).y == pytest.approx(0.7348, abs=1e-4)


@unhurried
@given(st.floats(-0.3, 0.3))
def test_at_nominal_load_and_pressure_the_print_is_right(slip):
    """E-01 and E-02 concern the change of load and pressure only."""
    m = PARAMETERS.magic_formula
    arguments = slip, m.nominal_load, m.nominal_pressure, m
    assert tyre.magic_formula_printed(*arguments) == pytest.approx(tyre.magic_formula(*arguments), rel=1e-12)


def test_below_nominal_load_the_print_exaggerates_the_change():
    """E-01: at half the nominal load df_z is -0.5; the print divides by the actual load and takes -1."""
    m = PARAMETERS.magic_formula._replace(PKx2=10.0, PKx3=0.0)
    linear = m._replace(PDx2=0.0, PEx2=0.0, PEx3=0.0, PHx1=0.0, PHx2=0.0, PVx1=0.0, PVx2=0.0)
    arguments = 1e-7, m.nominal_load / 2, m.nominal_pressure, linear
    stiffness = linear.PKx1 * m.nominal_load / 2
    gain = 10.0 * m.nominal_load / 2
    assert tyre.magic_formula(*arguments) / 1e-7 == pytest.approx(stiffness - 0.5 * gain, rel=1e-4)
    assert tyre.magic_formula_printed(*arguments) / 1e-7 == pytest.approx(stiffness + gain, rel=1e-4)
