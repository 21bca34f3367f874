"""Estimators against worked vectors, independent free-body solutions, and the laws they have to obey.

Vectors were computed outside this project (docs/explanation/estimators.md): a free-body solve for the normal forces, integration of
the parabolic pressure for the brush model.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators import columns
from ecu.estimators.columns import estimate_columns
from ecu.estimators.estimate import corrected, follow_tilt
from ecu.estimators.joint import joint_at
from ecu.estimators.live import LiveEstimator
from ecu.estimators.loads.normal_force import rigid_normal_forces, standing
from ecu.estimators.motion.motion import Motion
from ecu.estimators.parameters import Geometry
from ecu.estimators.printed.estimate import printed
from ecu.estimators.printed.state import PRINTED_INITIAL
from ecu.estimators.quantities import Centre, NormalForces, Vector, WheelForces
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.stability import turning
from ecu.estimators.state import INITIAL
from ecu.estimators.tyres import tyre
from tests.ecu.machine import STANDING

unhurried = settings(deadline=None)  # the first example compiles
CALIBRATION = load_calibration()
PARAMETERS = CALIBRATION.parameters
GEOMETRY = Geometry(1.5, 1.5, 1.93, 1.93, 0.90, math.radians(40))
MASS, FRONT, REAR, HEIGHT, AXLE, AXLE_HEIGHT = (
    11092.0,
    (4300.0, 1.6442),
    (6792.0, -1.20),
    1.11071,
    750.0,
    0.72,
)

angles = st.floats(-0.7, 0.7)
forces = st.floats(-5.0, 5.0)


def centre(angle):
    x = (FRONT[0] * FRONT[1] * math.cos(angle) + REAR[0] * REAR[1]) / MASS
    return Centre(MASS, x, FRONT[0] * FRONT[1] * math.sin(angle) / MASS, HEIGHT)


def loads(angle, fx, fy, fz, share=0.5):
    return rigid_normal_forces(centre(angle), angle, fx, fy, fz, AXLE, AXLE_HEIGHT, share, GEOMETRY)


@pytest.mark.parametrize(
    ("angle", "fx", "fy", "fz", "expected"),
    [
        (0.0, 0.0, 0.0, 9.81, (25436.7, 25436.7, 57939.2, 32648.3, 32648.3)),
        (0.3, 0.0, 0.0, 9.81, (24294.7, 26472.7, 58045.1, 32701.3, 32701.3)),
        (0.3, 1.0, 2.0, 9.7, (14602.2, 29930.5, 63059.8, 29435.4, 40899.4)),
        (-0.5, -3.0, -1.5, 9.81, (43000.5, 17720.8, 48091.2, 32023.3, 23425.3)),
    ],
)
def test_normal_forces_of_worked_cases(angle, fx, fy, fz, expected):
    assert loads(angle, fx, fy, fz) == pytest.approx(
        expected, abs=1.0
    )  # 1.6442 m is rounded: 4300 kg g 5e-5 m / 3 m = 0.7 N


def free_body(angle, fx, fy, fz, share):
    """Wheel loads from four balances of the free bodies, solved as a linear system.

    Whole machine: vertical, roll and pitch about the joint on the ground; rear axle: roll about its pivot.
    """
    c, lr, half = centre(angle), GEOMETRY.rear_length, 1.93 / 2
    lf, cd, sd = GEOMETRY.front_length, math.cos(angle), math.sin(angle)
    x = np.array((lf * cd - half * sd, lf * cd + half * sd, -lr, -lr))
    y = np.array((lf * sd + half * cd, lf * sd - half * cd, half, -half))
    left = np.array((np.ones(4), y, x, (0, 0, half, -half)))
    right = (
        (MASS + AXLE) * fz,
        c.y * MASS * fz - (HEIGHT * MASS + AXLE_HEIGHT * AXLE) * fy,
        c.x * MASS * fz - lr * AXLE * fz - (HEIGHT * MASS + AXLE_HEIGHT * AXLE) * fx,
        -(share * MASS * GEOMETRY.pivot_height + AXLE * AXLE_HEIGHT) * fy,
    )
    return np.linalg.solve(left, right)


@unhurried
@given(angles, forces, forces, st.floats(7.0, 12.0), st.floats(0.2, 0.7))
def test_every_balance_of_the_free_bodies_holds(angle, fx, fy, fz, share):
    n = loads(angle, fx, fy, fz, share)
    found = (n.front_left, n.front_right, n.rear_left, n.rear_right)
    assert found == pytest.approx(free_body(angle, fx, fy, fz, share), rel=1e-9, abs=1e-4)


@unhurried
@given(angles, forces, forces)
def test_left_and_right_are_mirrored(angle, fx, fy):
    n, m = loads(angle, fx, fy, 9.81), loads(-angle, fx, -fy, 9.81)
    assert (n.front_left, n.rear_left) == pytest.approx((m.front_right, m.rear_right), abs=1e-6)


@unhurried
@given(st.floats(0.2, 3.0), st.floats(0.2, 3.0), st.floats(0.1, 2.0), st.floats(-0.5, 0.5))
def test_a_grade_moves_load_and_keeps_the_sum(front, rear, height, grade):
    """Two front and two rear wheels carry m g cos(theta); level ground shares by the opposite distance."""
    f, r = standing(1e5, front, rear, grade, height)
    assert 2 * (f + r) == pytest.approx(1e5 * math.cos(grade))
    level = standing(1e5, front, rear, 0.0, height)
    assert level[0] * front == pytest.approx(level[1] * rear)
    shift = 1e5 * math.sin(grade) * height / (front + rear) / 2
    assert (f - level[0] * math.cos(grade), r - level[1] * math.cos(grade)) == pytest.approx(
        (-shift, shift), abs=1e-6
    )


@pytest.mark.parametrize(
    ("slip", "force"),
    [(0.01, 4046.3), (0.05, 17032.9), (0.1, 23929.7), (0.3, 23759.3), (1.0, 17872.0), (2.5, 15317.3)],
)
def test_magic_formula_of_a_worked_case(slip, force):
    C, D, K = 1.65, 25_500.0, 408_000.0
    assert tyre.magic_formula_shape(slip, K / (C * D), C, D, 0.3) == pytest.approx(force, abs=0.06)


@pytest.mark.parametrize(
    ("slip", "force"),
    [(-0.2, -25500), (0.01, 3830.0), (0.05, 14912.0), (0.1, 22013.9), (0.3, 25500), (-1.5, -25500)],
)
def test_brush_of_a_worked_case(slip, force):
    assert tyre.brush(slip, 34e3, 0.75, 408e3) == pytest.approx(force, abs=0.06)


@unhurried
@given(st.floats(-0.99, 5.0), st.floats(1e3, 1e5))
def test_tyre_forces_oppose_sliding_and_stay_within_friction(slip, load):
    """Driving slip gives a driving force: the power F V_s lost in the contact is never negative."""
    assert tyre.brush(slip, load, 0.75, 12 * load) * slip >= 0
    assert abs(tyre.brush(slip, load, 0.75, 12 * load)) <= 0.75 * load * (1 + 1e-12)
    m = PARAMETERS.magic_formula
    assert tyre.magic_formula(slip, load, m.nominal_pressure, m) * slip >= 0


@unhurried
@given(st.floats(-5, 5), st.floats(-3, 3))
def test_lateral_force_opposes_lateral_sliding(along, across):
    """E-03: a patch that moves to the left is pushed to the right."""
    angle = tyre.slip_angle(along, across, 0.1)
    assert tyre.lateral_force(angle, 3e4, PARAMETERS.wheel) * across <= 0


def test_load_enters_the_magic_formula_over_the_nominal_load():
    """E-01: 48 kN over 34 kN is df = 0.412, not 0.292; its slope in slip is K(df) = F_z PKx1 exp(PKx3 df)."""
    m = PARAMETERS.magic_formula._replace(PKx2=0.0, PKx3=-0.5, nominal_load=34e3)
    step = 1e-7
    slope = (
        tyre.magic_formula(step, 48e3, m.nominal_pressure, m)
        - tyre.magic_formula(-step, 48e3, m.nominal_pressure, m)
    ) / (2 * step)
    assert slope == pytest.approx(48e3 * m.PKx1 * math.exp(-0.5 * 14 / 34), rel=1e-5)


def test_relaxation_of_a_worked_case():
    """0.3 m, 1 m/s, slip 0.02: 0.0193 after a second; in ten steps or in one."""
    assert tyre.contact_point(0.0, 0.02, 1.0, 0.3, 1.0) / 0.3 == pytest.approx(0.0193, abs=5e-5)
    u = 0.0
    for _ in range(10):
        u = tyre.contact_point(u, 0.02, 1.0, 0.3, 0.1)
    assert u == pytest.approx(tyre.contact_point(0.0, 0.02, 1.0, 0.3, 1.0), rel=1e-12)


@unhurried
@given(st.floats(0.3, 0.99), st.floats(0.3, 1.5))
def test_the_effective_radius_lies_between_loaded_and_unloaded(share, unloaded):
    """(3)."""
    loaded = share * unloaded
    assert loaded < tyre.effective_radius(loaded, unloaded) < unloaded


@unhurried
@given(st.floats(1e3, 1e5), st.floats(0.6, 1.4))
def test_deflection_inverts_the_radial_law(force, stiffening):
    w = PARAMETERS.wheel
    assert tyre.radial_force(tyre.deflection(force, stiffening, w), stiffening, w) == pytest.approx(
        force, rel=1e-9
    )


@unhurried
@given(angles, forces, forces)
def test_turning_a_force_keeps_its_length(angle, x, y):
    assert math.hypot(*turning.to_rear_axes(x, y, angle)) == pytest.approx(math.hypot(x, y), abs=1e-12)


@unhurried
@given(angles, st.lists(st.floats(-2e4, 2e4), min_size=8, max_size=8))
def test_yaw_moment_is_the_cross_product_of_every_contact(angle, values):
    """Sum of r x F over the four contacts, written with vectors."""
    f = WheelForces(*values)
    c = centre(angle)
    turn = np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))
    half = 1.93 / 2
    points = [turn @ (1.5, half), turn @ (1.5, -half), np.array((-1.5, half)), np.array((-1.5, -half))]
    pushes = [turn @ (f.x1, f.y1), turn @ (f.x2, f.y2), np.array((f.x3, f.y3)), np.array((f.x4, f.y4))]
    moment = sum((p[0] - c.x) * q[1] - (p[1] - c.y) * q[0] for p, q in zip(points, pushes, strict=True))
    assert turning.yaw_moment(f, c.x, c.y, angle, GEOMETRY) == pytest.approx(moment, abs=1e-6)


def drive(rows, seed):
    """Plausible inputs of a moving machine."""
    rng = np.random.default_rng(seed)
    names = Inputs._fields
    table = np.zeros((rows, len(names)))
    for k, name in enumerate(names):
        table[:, k] = STANDING.get(name, 1.0 if name.endswith("usable") else 0.0)
    wander = {"articulation_angle": 0.4, "articulation_rate": 0.2, "specific_force_x": 1.0, "specific_force_y": 2.0,
              "yaw_rate": 0.3, "roll_rate": 0.05, "pitch_rate": 0.05, "roll": 0.05, "pitch": 0.05}  # fmt: skip
    for name, size in wander.items():
        table[:, names.index(name)] = size * np.sin(
            np.arange(rows) * rng.uniform(0.01, 0.05) + rng.uniform(0, 6)
        )
    for n in (1, 2, 3, 4):
        table[:, names.index(f"wheel_speed_{n}")] = 6.0 + 0.3 * rng.standard_normal(rows).cumsum() / 50
        table[:, names.index(f"wheel_torque_{n}")] = 2e3 * np.sin(np.arange(rows) * 0.02)
    table[:, names.index("dt")], table[:, names.index("rate_limit")] = 0.01, 0.8
    return table


@pytest.mark.parametrize(
    ("form", "function", "initial"),
    [("corrected", corrected, INITIAL), ("printed", printed, PRINTED_INITIAL)],
)
def test_a_recording_gives_what_the_ecu_gave_cycle_by_cycle(form, function, initial):
    """Columns and live loop are the same compiled function: equal bit for bit. A reset forgets everything."""
    rows = drive(400, 1)
    plain, state = [], initial
    for row in rows:
        estimates, state = function(Inputs(*row.tolist()), state, PARAMETERS)
        plain.append(estimates)
    live = LiveEstimator(PARAMETERS, form)
    for _ in range(2):
        assert [live.estimate(Inputs(*row.tolist())) for row in rows] == plain
        live.reset()
    np.testing.assert_array_equal(estimate_columns(rows, PARAMETERS, form=form), np.array(plain))


@pytest.mark.parametrize("rows", [64 * 2, 64 * 5 + 7, 64 * 12])
def test_any_number_of_cores_gives_the_rows_of_one(rows, monkeypatch):
    """Blocks that begin in the middle of a drive go on from the state before them."""
    monkeypatch.setattr(columns, "BLOCK", 64)
    table = drive(rows, 2)
    live = LiveEstimator(PARAMETERS, "corrected")
    one_by_one = np.array([live.estimate(Inputs(*row.tolist())) for row in table])
    for cores in (1, 2, 3):
        np.testing.assert_array_equal(estimate_columns(table, PARAMETERS, cores=cores), one_by_one)


def test_an_error_of_any_block_is_raised(monkeypatch):
    """Two rows at the same time have no rate between them."""
    monkeypatch.setattr(columns, "BLOCK", 64)
    table = drive(64 * 20, 2)
    table[64 * 10 + 3, Inputs._fields.index("dt")] = 0.0
    for cores in (1, 2):
        with pytest.raises(ZeroDivisionError):
            estimate_columns(table, PARAMETERS, cores=cores)


def test_without_the_prediction_the_present_is_the_same():
    rows = drive(300, 4)
    whole, now = estimate_columns(rows, PARAMETERS), estimate_columns(rows, PARAMETERS, prediction=False)
    later = {
        "predicted_load_transfer_ratio",
        "predicted_margin",
        "time_to_lift_off",
        "lifting_wheel",
        "permitted_rate",
        "permitted_direction",
        "permitted_speed",
        "permitted_lever",
        "permitted_motion",
    }
    for k, name in enumerate(Estimates._fields):
        if name in later:
            assert np.isnan(now[:, k]).all()
        else:
            np.testing.assert_array_equal(now[:, k], whole[:, k], err_msg=name)


@given(st.integers(0, 2**31))
@settings(max_examples=5, deadline=None)
def test_weight_is_shared_whatever_the_machine_does(seed):
    """Sum of the four loads = mass times the vertical specific force, which only the gyro's levers tilt."""
    rows = drive(50, seed)
    found = estimate_columns(rows, PARAMETERS)
    total = found[:, :4].sum(axis=1)
    assert total == pytest.approx(11842 * 9.81, rel=0.06)


def test_wrong_columns_are_refused():
    with pytest.raises(ValueError, match="shape"):
        estimate_columns(np.zeros((3, 4)), PARAMETERS)


def test_wheels_that_agree_mend_a_wrong_speed():
    """A state that believes the machine stands although it rolls at 4.3 m/s is right again within three seconds."""
    rows = drive(400, 2)
    for name in ("articulation_angle", "articulation_rate", "yaw_rate", "specific_force_x", "pitch"):
        rows[:, Inputs._fields.index(name)] = 0.0
    for n in (1, 2, 3, 4):
        rows[:, Inputs._fields.index(f"wheel_speed_{n}")] = 6.0
        rows[:, Inputs._fields.index(f"wheel_torque_{n}")] = 0.0
    first = Inputs(*rows[0].tolist())
    truth, _ = corrected(first, INITIAL, PARAMETERS)
    state = INITIAL._replace(
        cycles=1.0, speed=0.0, normal_1=27e3, normal_2=27e3, normal_3=31e3, normal_4=31e3,
        lift_angle=first.lift_arm_angle, lift_sample=first.lift_arm_angle,
        tilt_angle=first.tilt_angle, tilt_sample=first.tilt_angle,
    )  # fmt: skip
    for row in rows:
        estimates, state = corrected(Inputs(*row.tolist()), state, PARAMETERS)
    assert estimates.speed == pytest.approx(truth.speed, rel=0.03)


@given(st.floats(-1.0, 1.0), st.floats(1e3, 1e5), st.floats(1.0, 3.0))
@settings(deadline=None, max_examples=40)
def test_however_curved_the_magic_formula_pushes_along_its_slip(slip, load, curvature):
    """E above 1 turned the curve over: -25.5 kN at slip +1."""
    m = PARAMETERS.magic_formula._replace(
        PEx1=curvature, PEx2=0.0, PEx3=0.0, PEx4=0.0, PHx1=0.0, PHx2=0.0, PVx1=0.0, PVx2=0.0
    )
    assert tyre.magic_formula(slip, load, m.nominal_pressure, m) * slip >= 0.0


def test_where_no_friction_is_left_there_is_no_force():
    """D = 0: extrapolated in load to where the peak has gone."""
    m = PARAMETERS.magic_formula._replace(PDx1=0.0, PDx2=0.0, PVx1=0.0, PVx2=0.0)
    assert tyre.magic_formula(0.3, m.nominal_load, m.nominal_pressure, m) == 0.0


def test_driving_slip_of_a_wheel_that_stands_is_finite():
    """Omega = 0; elsewhere it is kappa / (1 + kappa)."""
    assert tyre.driving_slip(0.0, 0.7, 1.0, 0.5) == pytest.approx(-2.0)
    kappa = tyre.slip(10.0, 0.7, 5.0, 0.5)
    assert tyre.driving_slip(10.0, 0.7, 5.0, 0.5) == pytest.approx(kappa / (1.0 + kappa))


def test_a_tick_without_a_wheels_load_keeps_the_tilt_of_the_gyro():
    """The deflection of an unloaded tyre says nothing of the tilt; the balance gave 10 mrad where the machine had 30."""
    i = Inputs(*drive(2, 1)[1].tolist())._replace(roll_rate=0.2, pitch_rate=0.0, yaw_rate=0.0)
    s = INITIAL._replace(cycles=500.0, roll_tilt=0.03, pitch_tilt=0.001, roll_bias=0.01)
    moved = Motion(Vector(0.2, 0.0, 0.0), Vector(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0)
    lifted = NormalForces(-500.0, 50e3, 55e3, 31e3, 31e3)
    n, followed = follow_tilt(i, s, moved, lifted, joint_at(i.articulation_angle), PARAMETERS)
    assert n == lifted
    assert followed.tilt.roll == pytest.approx(0.03 + (0.2 - 0.01) * i.dt)
    assert followed.bias.roll == 0.01
