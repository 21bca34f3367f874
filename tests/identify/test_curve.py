"""The Magic Formula and its transient: laws, test vectors, and derivatives against finite differences."""

import numpy as np
import pytest

from identify.make.drum import drum_force, steady_force, wheel_block
from identify.make.rig import tyre_values
from identify.tyre.curve import force_and_slope, steady
from identify.tyre.parameters import NAMES, Nominal, curve, vector
from identify.tyre.transient import CARCASS, COLUMNS, CONSTANT, GAIN, LAW, SCALE, START, TARE, response
from plant.sheets.machine import load_machine

CURVE = np.array([408e3, 1.65, 25.5e3, 0.3, 0.1, 0.004, 120.0])
FULL = {
    "PCX1": 1.5, "PDX1": 0.8, "PDX2": -0.05, "PEX1": 0.3, "PEX2": -0.4, "PEX3": 0.2, "PEX4": 0.1, "PKX1": 7.5, "PKX2": 0.6, "PKX3": -0.12,
    "PHX1": 0.002, "PHX2": 0.001, "PVX1": 0.01, "PVX2": 0.004, "PPX1": -0.35, "PPX2": 0.1, "PPX3": -0.08, "PPX4": 0.05,
}  # fmt: skip
NOMINAL = Nominal(load=34e3, pressure=3.5e5, radius=0.743)


def force(c, kappa):
    return force_and_slope(c, kappa, np.empty(7), np.empty(7))


def test_force_is_the_test_vector_of_the_formula():
    c = np.array([408e3, 1.65, 25.5e3, 0.3, 0.3, 0.0, 0.0])
    got = [force(c, k)[0] for k in (0.01, 0.05, 0.1, 0.3, 1.0, 2.5)]
    assert got == pytest.approx([4046.3, 17032.9, 23929.7, 23759.3, 17872.0, 15317.3], abs=0.06)


@pytest.mark.parametrize("kappa", [-0.6, -0.02, 0.03, 0.2, 2.0])
def test_derivatives_of_force_and_slope_are_those_of_differences(kappa):
    by_force, by_slope = np.empty(7), np.empty(7)
    f, slope = force_and_slope(CURVE, kappa, by_force, by_slope)
    assert slope == pytest.approx(
        (force(CURVE, kappa + 1e-6)[0] - force(CURVE, kappa - 1e-6)[0]) / 2e-6, rel=1e-6
    )
    for i in range(7):
        step = 1e-5 * max(abs(CURVE[i]), 0.01)
        up, down = CURVE.copy(), CURVE.copy()
        up[i] += step
        down[i] -= step
        for column, which in ((by_force, 0), (by_slope, 1)):
            wanted = (force(up, kappa)[which] - force(down, kappa)[which]) / (2.0 * step)
            assert column[i] == pytest.approx(wanted, rel=1e-4, abs=1e-7 * abs((f, slope)[which]) / step)


def test_parameters_make_the_curve_of_the_plants_tyre():
    machine = load_machine("l60")
    p, kappa = vector(tyre_values(machine)), np.linspace(-0.9, 2.8, 60)
    for load, bar in ((34e3, 3.5), (48e3, 3.5), (20e3, 2.0), (34e3, 5.0)):
        c, _, _ = curve(p, NOMINAL, load, bar * 1e5)
        got, by = np.empty(60), np.empty((60, 7))
        steady(np.tile(c, (60, 1)), kappa, got, by)
        assert got == pytest.approx(steady_force(wheel_block(machine, bar), 1.0, load, kappa), abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_curve_moves_with_each_parameter_as_derived(name):
    p, i = vector(FULL), NAMES.index(name)
    _, by, _ = curve(p, NOMINAL, 45e3, 2.2e5)
    step = np.zeros(18)
    step[i] = 1e-6
    wanted = (curve(p + step, NOMINAL, 45e3, 2.2e5)[0] - curve(p - step, NOMINAL, 45e3, 2.2e5)[0]) / 2e-6
    assert by[:, i] == pytest.approx(wanted, rel=1e-6, abs=1e-4)


def test_curve_moves_with_load_as_derived():
    p = vector(FULL)
    _, _, by_load = curve(p, NOMINAL, 45e3, 2.2e5)
    wanted = (curve(p, NOMINAL, 45.1e3, 2.2e5)[0] - curve(p, NOMINAL, 44.9e3, 2.2e5)[0]) / 200.0
    assert by_load == pytest.approx(wanted, rel=1e-4, abs=1e-9)


def run(
    curve_=CURVE,
    law=CARCASS,
    number=0.75e6,
    scale=0.0,
    start=0.0,
    gain=1.0,
    tare=0.0,
    noise=0.0,
    gains=None,
    held=False,
):
    t = np.arange(0.0, 6.0, 0.01)
    speed = 0.6 + 0.2 * np.sin(t)
    wheel = speed * (1.0 + 0.3 * np.sin(0.7 * t) ** 3 + 0.02) * (1.0 + scale)
    measured = 8e3 * np.sin(0.7 * t)
    n = t.size
    kappa, out, by = np.empty(n), np.empty(n), np.empty((n, COLUMNS))
    response(
        law,
        number,
        0.05,
        curve_,
        speed,
        wheel,
        0.01,
        start,
        measured,
        gain,
        tare,
        np.full(n, noise),
        50.0,
        held,
        np.zeros(n) if gains is None else gains,
        kappa,
        out,
        by,
    )
    return out, by


@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize("law", [CARCASS, CONSTANT])
def test_derivatives_of_the_transient_are_those_of_differences(law, noise):
    number = {CARCASS: 0.75e6, CONSTANT: 0.4}[law]
    gains = np.zeros(600)
    free, _ = run(law=law, number=number, noise=noise, gains=gains, held=False)
    held = {"gains": gains, "held": True}
    out, by = run(law=law, number=number, **held)
    assert np.array_equal(out, free)
    assert gains.any() == (noise > 0.0)
    changes = {LAW: ("number", number, 1e-4 * number), SCALE: ("scale", 0.0, 1e-6), START: ("start", 0.0, 1e-6), GAIN: ("gain", 1.0, 1e-4), TARE: ("tare", 0.0, 0.1)}  # fmt: skip
    for column, (name, at, step) in changes.items():
        up, down = (
            run(**{**held, "law": law, "number": number, name: at + s * step})[0] for s in (1.0, -1.0)
        )
        wanted = (up - down) / (2.0 * step)
        assert by[:, column] == pytest.approx(wanted, rel=2e-3, abs=2e-4 * float(np.max(np.abs(wanted))))
    for i in range(7):
        step = 1e-6 * max(abs(CURVE[i]), 1e-3)
        up, down = CURVE.copy(), CURVE.copy()
        up[i] += step
        down[i] -= step
        wanted = (run(up, law, number, **held)[0] - run(down, law, number, **held)[0]) / (2.0 * step)
        assert by[:, i] == pytest.approx(wanted, rel=5e-3, abs=1e-3 * float(np.max(np.abs(wanted))))


def test_slip_settles_over_the_relaxation_length():
    n = 1001
    c = np.array([408e3, 1.65, 25.5e3, 0.3, 0.3, 0.0, 0.0])
    kappa, out, by = np.empty(n), np.empty(n), np.empty((n, COLUMNS))
    still = np.zeros(n)
    response(
        CONSTANT,
        0.3,
        0.05,
        c,
        np.ones(n),
        np.full(n, 1.02),
        0.001,
        0.0,
        still,
        1.0,
        0.0,
        still,
        1.0,
        False,
        np.zeros(n),
        kappa,
        out,
        by,
    )
    assert kappa[-1] == pytest.approx(0.02 * (1.0 - np.exp(-1.0 / 0.3)), rel=1e-6)


def test_transient_follows_the_plants_tyre():
    machine = load_machine("l60")
    t = np.arange(0.0, 8.0, 0.001)
    speed, wheel = np.full(t.size, 0.5), 0.5 * (1.0 + 1.5 * np.sin(0.4 * t) ** 4)
    truth, _ = drum_force(wheel_block(machine, 3.5), 1.0, np.full(t.size, 40e3), speed, wheel, 0.001)
    c, _, _ = curve(vector(tyre_values(machine)), NOMINAL, 40e3, 3.5e5)
    few = slice(None, None, 10)
    n = t[few].size
    kappa, out, by = np.empty(n), np.empty(n), np.empty((n, COLUMNS))
    still = np.zeros(n)
    response(
        CARCASS,
        0.75e6,
        0.05,
        c,
        speed[few],
        wheel[few],
        0.01,
        0.0,
        still,
        1.0,
        0.0,
        still,
        1.0,
        False,
        np.zeros(n),
        kappa,
        out,
        by,
    )
    assert np.max(np.abs(out - truth[few])) < 0.001 * 32e3
