"""Brush, .tir file: known answers, and fits that give back what made the data."""

import numpy as np
import pytest

from identify.tyre.brush import brush_force, fit_brush
from identify.tyre.parameters import Nominal
from identify.tyre.tir_file import tir_text
from plant.sheets.tyre_file import read_tir

NOMINAL = Nominal(load=34e3, pressure=3.5e5, radius=0.743)


def test_brush_is_its_test_vector():
    kappa = np.array([-0.2, 0.01, 0.05, 0.1, 0.3])
    assert brush_force(kappa, 34e3, 0.75, 408e3)[0] == pytest.approx(
        [-25500.0, 3830.0, 14912.0, 22013.9, 25500.0], abs=0.06
    )


def test_brush_slides_where_the_sliding_limit_says():
    limit = 3.0 * 0.75 * 34e3 / 408e3
    kappa = limit / (1.0 - limit)  # sigma = kappa/(1 + kappa)
    _, _, by_stiffness = brush_force(np.array([kappa * 0.999, kappa * 1.001]), 34e3, 0.75, 408e3)
    assert by_stiffness[0] > 0.0
    assert by_stiffness[1] == 0.0


def test_brush_derivatives_are_those_of_differences():
    kappa = np.array([-0.15, -0.02, 0.01, 0.08, 0.5])
    _, by_friction, by_stiffness = brush_force(kappa, 34e3, 0.75, 408e3)
    up, down = (brush_force(kappa, 34e3, 0.75 + s, 408e3)[0] for s in (1e-6, -1e-6))
    assert by_friction == pytest.approx((up - down) / 2e-6, rel=1e-5, abs=1e-3)
    up, down = (brush_force(kappa, 34e3, 0.75, 408e3 + s)[0] for s in (1.0, -1.0))
    assert by_stiffness == pytest.approx((up - down) / 2.0, rel=1e-5, abs=1e-9)


def test_brush_is_recovered_within_its_intervals():
    random = np.random.default_rng(1)
    kappa = random.uniform(-0.3, 0.5, 400)
    force = brush_force(kappa, 30e3, 0.68, 350e3)[0] + 300.0 * random.standard_normal(400)
    found = fit_brush(kappa, force, 30e3)
    assert abs(found.friction - 0.68) < 3.0 * found.friction_sd
    assert abs(found.slip_stiffness - 350e3) < 3.0 * found.slip_stiffness_sd
    assert fit_brush(kappa, force, 30e3, friction=0.68).slip_stiffness == pytest.approx(350e3, rel=0.03)


def test_tir_file_reads_back_what_was_written(tmp_path):
    values = {"PCX1": 1.4, "PDX1": 0.8123456789, "PKX1": 7.5, "PEX1": -0.3}
    file = tmp_path / "tyre.tir"
    file.write_text(
        tir_text(
            values,
            NOMINAL,
            vertical_stiffness=7e5,
            notes={"PCX1": "identified"},
            comments=("made by a test",),
        )
    )
    read = read_tir(file)
    assert {n: read.numbers[n] for n in values} == values
    assert (read.numbers["FNOMIN"], read.numbers["NOMPRES"], read.numbers["UNLOADED_RADIUS"]) == (
        34e3,
        3.5e5,
        0.743,
    )
