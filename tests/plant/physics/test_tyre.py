"""Laws of one tyre: worked examples, geometry, dissipation, relaxation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from plant.physics import parameters as p
from plant.physics import state as s
from plant.physics.surface import Surface
from plant.physics.tyre import (
    combined_forces,
    effective_radius,
    magic_formula,
    magic_slope,
    radial_force,
    relax,
    stiffness_and_peak,
    wheel_contact,
)
from plant.sheets.machine import load_machine

MACHINE = load_machine("l60")
VECTOR = p.parameter_vector(MACHINE, Surface(), 0.0)
FRONT = VECTOR[p.P_WHEELS : p.P_WHEELS + p.WHEEL_SIZE]
REAR = VECTOR[p.P_WHEELS + 2 * p.WHEEL_SIZE : p.P_WHEELS + 3 * p.WHEEL_SIZE]
UP, LEFT = np.array((0.0, 0.0, 1.0)), np.array((0.0, 1.0, 0.0))

slips = st.floats(-1.5, 3.0)
sides = st.floats(-1.0, 1.0)
loads = st.floats(2e3, 90e3)


def steady(kappa, tan_alpha, load=34e3, w=FRONT, friction=1.0):
    return combined_forces(w, load, stiffness_and_peak(w, friction, load), kappa, tan_alpha)


def contact(
    height,
    *,
    axle=LEFT,
    normal=UP,
    centre=None,
    velocity=(0, 0, 0),
    turning=(0, 0, 0),
    spin=0.0,
    w=FRONT,
    **state,
):
    """Evaluate a wheel: velocity of its centre, angular velocity of its carrier, spin about the axle."""
    centre = np.array((0.0, 0.0, height)) if centre is None else centre
    omega = np.array(turning, float) + spin * axle
    motion = np.concatenate((omega, np.array(velocity, float) - np.cross(omega, centre)))
    out = np.zeros(s.T_OUTPUTS)
    kappa, tan_alpha = state.get("kappa", 0.0), state.get("tan_alpha", 0.0)
    wheel_contact(w, 1.0, 0.0, centre, height, axle, normal, motion, kappa, tan_alpha, 0.0, out)
    return out


@pytest.mark.parametrize(
    ("kappa", "force"),
    [(0.01, 4046.3), (0.05, 17032.9), (0.1, 23929.7), (0.3, 23759.3), (1.0, 17872.0), (2.5, 15317.3)],
)
def test_magic_formula_worked_example(kappa, force):
    """docs/explanation/estimators.md: C 1.65, D 25 500 N, K 408 000 N, E 0.3; printed to 0.1 N."""
    assert magic_formula(kappa, 408e3, 1.65, 25.5e3, 0.3) == pytest.approx(force, abs=0.06)


@given(slips, st.floats(0.0, 0.9))
def test_slope_is_the_derivative_of_the_force(slip, curvature):
    """Central difference over 2e-5; its own error is of the order of 1e-5 of the stiffness."""
    curve = (408e3, 1.65, 25.5e3, curvature)
    h = 1e-5
    difference = (magic_formula(slip + h, *curve) - magic_formula(slip - h, *curve)) / (2 * h)
    assert magic_slope(slip, *curve) == pytest.approx(difference, abs=1e-5 * 408e3)


def test_peak_is_where_pacejka_puts_it():
    """MF 6.1: the maximum is D, at the slip that makes E = (B k - tan(pi/2C))/(B k - atan(B k))."""
    stiffness, shape, peak, where = 255e3, 1.4, 27.2e3, 0.38
    bk = stiffness / (shape * peak) * where
    curvature = (bk - math.tan(math.pi / (2 * shape))) / (bk - math.atan(bk))
    assert magic_formula(where, stiffness, shape, peak, curvature) == pytest.approx(peak, rel=1e-12)


def test_asphalt_anchors():
    """machine sheet 3.2 at the nominal load: peak near slip 0.38, 0.75 at slip 1, 0.70 at 2.5 (two digits given)."""
    kappa = np.linspace(0.01, 3.0, 3000)
    force = np.array([steady(k, 0.0)[0] for k in kappa]) / 34e3
    assert kappa[np.argmax(force)] == pytest.approx(0.38, abs=0.03)
    assert np.interp(1.0, kappa, force) == pytest.approx(0.75, abs=0.01)
    assert np.interp(2.5, kappa, force) == pytest.approx(0.70, abs=0.01)


@given(slips, sides, loads)
def test_force_over_load_does_not_depend_on_load_without_load_terms(kappa, tan_alpha, load):
    w = FRONT.copy()
    w[[p.W_PKX2, p.W_PKX3, p.W_PDX2]] = 0.0
    along, _, _ = steady(kappa, tan_alpha, load, w)
    along_nominal, _, _ = steady(kappa, tan_alpha, 34e3, w)
    assert along / load == pytest.approx(along_nominal / 34e3, rel=1e-12, abs=1e-15)


@given(slips, sides, loads)
def test_left_and_right_are_mirror_images(kappa, tan_alpha, load):
    along, across, aligning = steady(kappa, tan_alpha, load)
    assert steady(kappa, -tan_alpha, load) == (along, -across, -aligning)


@given(st.floats(-6.0, 6.0), sides, sides, st.floats(-2.0, 2.0))
def test_a_tyre_has_no_front(speed, kappa, tan_alpha, drift):
    """The same wheel with its axle named the other way round: travel and slips change their signs, and the wrench on the machine stays.

    A side force that drags in forward travel would lead in reverse if its trail did not turn with the travel.
    """
    moving = {"velocity": (speed, drift, 0.0), "turning": (0.0, 0.0, 0.1)}
    one = contact(0.7, spin=speed / 0.7, kappa=kappa, tan_alpha=tan_alpha, **moving)
    other = contact(0.7, axle=-LEFT, spin=-speed / 0.7, kappa=-kappa, tan_alpha=-tan_alpha, **moving)
    wrench = slice(s.T_WRENCH, s.T_WRENCH + 6)
    np.testing.assert_allclose(other[wrench], one[wrench], rtol=1e-9, atol=1e-6)


def test_the_side_force_drags_whichever_way_the_tyre_rolls():
    """A force to the left that acts behind the middle of the contact turns the wheel to the right, in the direction of travel."""
    forwards, backwards = (
        contact(0.7, velocity=(v, 0.0, 0.0), spin=v / 0.7, tan_alpha=0.05) for v in (3.0, -3.0)
    )
    assert forwards[s.T_LATERAL] == backwards[s.T_LATERAL] > 0.0
    assert forwards[s.T_ALIGNING] == -backwards[s.T_ALIGNING] < 0.0


@given(slips, sides, loads)
def test_forces_stay_inside_the_friction_ellipse(kappa, tan_alpha, load):
    """Never outside, whatever the two slips; 1e-9 for rounding at the very peak."""
    along, across, _ = steady(kappa, tan_alpha, load)
    _, _, peak_x, peak_y = stiffness_and_peak(FRONT, 1.0, load)
    assert math.hypot(along / peak_x, across / peak_y) <= 1.0 + 1e-9


@given(slips, sides, loads)
def test_steady_tyre_dissipates(kappa, tan_alpha, load):
    """Sliding against the force: F_x V_sx <= 0 and F_y V_sy <= 0 (V_sx = -kappa V_x, V_sy = -tan alpha V_x)."""
    along, across, _ = steady(kappa, tan_alpha, load)
    assert along * kappa >= 0.0
    assert across * tan_alpha >= 0.0


def test_friction_scales_the_peak_and_leaves_the_stiffness():
    low, high = stiffness_and_peak(FRONT, 0.5, 30e3), stiffness_and_peak(FRONT, 1.0, 30e3)
    assert low[:2] == high[:2]
    assert (2 * low[2], 2 * low[3]) == pytest.approx(high[2:], rel=1e-15)


@pytest.mark.parametrize(
    ("load", "tangent", "secant"), [(27e3, 760e3, 692e3), (34e3, 790e3, 708e3), (48e3, 850e3, 737e3)]
)
def test_vertical_stiffness(load, tangent, secant):
    """machine sheet 3.1 at 3.5 bar. 1 %: it rounds to 10 and to 1 kN/m, and its law to three digits."""
    deflection = np.linspace(0.0, 0.12, 120001)
    force = np.array([radial_force(FRONT, d, 0.0) for d in deflection])
    at = float(np.interp(load, force, deflection))
    assert load / at == pytest.approx(secant, rel=0.01)
    slope = (radial_force(FRONT, at + 1e-6, 0.0) - radial_force(FRONT, at - 1e-6, 0.0)) / 2e-6
    assert slope == pytest.approx(tangent, rel=0.01)


def test_rear_tyre_is_softer_by_its_pressure():
    """2.5 against 3.5 bar: 0.80 (1 + 0.71 (2.5 - 3.5)/3.5 = 0.797)."""
    assert radial_force(REAR, 0.05, 0.0) / radial_force(FRONT, 0.05, 0.0) == pytest.approx(0.797, abs=5e-4)


def test_tyre_never_pulls():
    assert radial_force(FRONT, -0.01, 1.0) == 0.0
    assert radial_force(FRONT, 0.01, -10.0) == 0.0
    assert contact(0.76)[s.T_NORMAL] == 0.0


@pytest.mark.parametrize(("load", "radius"), [(27e3, 0.7295), (48e3, 0.720)])
def test_effective_radius(load, radius):
    """machine sheet 3.1; and it lies between loaded and unloaded radius. 0.2 mm: the table has 0.5 mm or better."""
    deflection = np.linspace(0.0, 0.12, 12001)
    loaded = 0.743 - np.interp(load, [radial_force(FRONT, d, 0.0) for d in deflection], deflection)
    effective = effective_radius(loaded, 0.743)
    assert effective == pytest.approx(radius, abs=5e-4)
    assert loaded < effective < 0.743


def test_iso_signs():
    """Patch moving left: slip angle positive, force to the right; slow spin: braking; driven: force forward."""
    out = contact(0.70, velocity=(5.0, 0.5, 0.0), spin=5.0 / 0.72, tan_alpha=-0.05)
    assert out[s.T_SIDE_SLIP] == pytest.approx(0.1)
    assert out[s.T_TAN_ALPHA_RATE] < 0.0
    assert out[s.T_LATERAL] < 0.0
    assert out[s.T_ALIGNING] > 0.0, "turns the wheel towards its direction of travel"
    assert contact(0.70, velocity=(5.0, 0, 0), spin=0.0)[s.T_SLIP] == pytest.approx(-1.0)
    assert contact(0.70, velocity=(5.0, 0, 0), spin=8.0)[s.T_KAPPA_RATE] > 0.0
    assert contact(0.70, velocity=(-5.0, 0, 0), spin=0.0)[s.T_KAPPA_RATE] > 0.0, (
        "braking in reverse pushes forward"
    )


@settings(deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(0.60, 0.72), st.integers(0, 2**32 - 1))
def test_power_of_the_contact_is_spring_plus_sliding(lean, yaw, height, seed):
    """Virtual work: the wrench's power is -dU/dt of the radial spring plus force times sliding velocity.

    U is integrated here from the printed law; its rate is a difference quotient over 1e-6 s, good to 1e-5.
    """
    rng = np.random.default_rng(seed)
    w = FRONT.copy()
    w[[p.W_DAMPING, p.W_CARCASS_DAMPING]] = 0.0
    turn = Rotation.from_euler("ZX", (yaw, lean))
    centre = np.array((*rng.uniform(-1, 1, 2), height))
    velocity, omega, spin = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3), rng.uniform(-10, 10)
    axle = turn.as_matrix()[:, 1].copy()
    kappa, tan_alpha = rng.uniform(-0.3, 0.3, 2)
    out = contact(
        height,
        axle=axle,
        centre=centre,
        velocity=velocity,
        turning=omega,
        spin=spin,
        w=w,
        kappa=kappa,
        tan_alpha=tan_alpha,
    )

    def energy(t):
        moved = Rotation.from_rotvec(omega * t).apply(axle)
        d = max(0.743 - (height + velocity[2] * t) / math.sqrt(1.0 - moved[2] ** 2), 0.0)
        return 34e3 * (13.7 * d**2 / (2 * 0.743) + 27.6 * d**3 / (3 * 0.743**2))

    total = omega + spin * axle
    wrench = out[s.T_WRENCH : s.T_WRENCH + 6]
    power = wrench[:3] @ total + wrench[3:] @ (velocity - np.cross(total, centre))
    sliding = out[s.T_LONGITUDINAL] * out[s.T_SLIDING_X] + out[s.T_LATERAL] * out[s.T_SLIDING_Y]
    stored = (energy(1e-6) - energy(-1e-6)) / 2e-6
    expected = sliding + out[s.T_ALIGNING] * total[2] - stored
    assert power == pytest.approx(expected, abs=1e-5 * (abs(stored) + abs(sliding) + 1e4))


@given(st.integers(0, 2**32 - 1))
def test_any_axes_give_the_same_contact(seed):
    """Turning every input turns the wrench and leaves the scalars: no axis is special."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    axle = Rotation.from_euler("ZX", rng.uniform(-0.3, 0.3, 2)).as_matrix()[:, 1].copy()
    kwargs = {
        "velocity": rng.uniform(-3, 3, 3),
        "turning": rng.uniform(-1, 1, 3),
        "spin": 4.0,
        "kappa": 0.1,
        "tan_alpha": 0.05,
    }
    here = contact(0.70, axle=axle, **kwargs)
    kwargs["velocity"], kwargs["turning"] = turn @ kwargs["velocity"], turn @ kwargs["turning"]
    there = contact(0.70, axle=turn @ axle, normal=turn @ UP, centre=turn @ np.array((0, 0, 0.70)), **kwargs)
    np.testing.assert_allclose(there[: s.T_WRENCH], here[: s.T_WRENCH], rtol=1e-9, atol=1e-9)
    for part in (s.T_WRENCH, s.T_WRENCH + 3):
        np.testing.assert_allclose(there[part : part + 3], turn @ here[part : part + 3], rtol=0, atol=1e-6)


def test_a_wheel_on_its_side_has_no_contact():
    out = contact(0.1, axle=np.array((0.0, math.sin(0.1), math.cos(0.1))))
    assert not out[: s.T_ROLLING_RADIUS].any()


def relaxed(slip, speed, seconds, length=0.3, steps=10000):
    value = 0.0
    for _ in range(steps):
        value += seconds / steps * relax(value, speed, -slip * speed, length, 0.0)
    return value


def test_relaxation_follows_distance_not_time():
    """docs/explanation/estimators.md: 0.3 m, 1 m/s, slip 0.02 gives 0.0193 after 1 s; three digits. Twice the speed, half the time: the same."""
    assert relaxed(0.02, 1.0, 1.0) == pytest.approx(0.0193, abs=5e-5)
    assert relaxed(0.02, 2.0, 0.5) == pytest.approx(relaxed(0.02, 1.0, 1.0), rel=1e-9)


def test_relaxation_at_standstill_is_a_spring():
    """No speed: the slip is the carcass' deflection over the relaxation length, and stays."""
    assert relax(0.0, 0.0, 0.01, 0.3, 0.0) == pytest.approx(-0.01 / 0.3)
    assert relax(0.05, 0.0, 0.0, 0.3, 0.0) == 0.0


def test_implicit_relaxation_is_stable_at_any_speed():
    """One implicit step of any length lands between the old slip and the steady one."""
    for speed in (1.0, 100.0, 1e4):
        after = 0.5 + 1e-3 * relax(0.5, speed, -0.1 * speed, 0.05, 1e-3)
        assert 0.1 <= after <= 0.5


@given(st.floats(-1.0, 2.0), sides)
def test_contact_forces_are_those_of_the_transient_slips(kappa, tan_alpha):
    """At speed no damper acts: the wheel's forces are the steady ones at its load and transient slips."""
    out = contact(0.70, velocity=(5.0, 0.0, 0.0), spin=7.0, kappa=kappa, tan_alpha=tan_alpha)
    expected = steady(kappa, tan_alpha, out[s.T_NORMAL])
    assert (out[s.T_LONGITUDINAL], out[s.T_LATERAL], out[s.T_ALIGNING]) == expected
