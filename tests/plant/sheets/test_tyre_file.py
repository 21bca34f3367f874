"""Tyre property files: read, judged, driven on; forces against the published formula."""

from pathlib import Path

import numpy as np
import pytest

from configuration import ConfigurationError
from plant.physics.parameters import (
    P_WHEELS,
    W_LATERAL_STIFFNESS,
    W_LONGITUDINAL_STIFFNESS,
    W_PRESSURE,
    W_QFZ1,
    W_QFZ2,
    WHEEL_SIZE,
    parameter_vector,
)
from plant.physics.surface import Surface
from plant.physics.tyre import combined_forces, stiffness_and_peak
from plant.plant import Plant
from plant.sheets.machine import load_machine
from plant.sheets.tyre_file import GROUPS, MACHINERY, lacking, read_tir, tyre_values
from tests.plant.oracle import magic_formula

FILE = """
! a comment
$----------------
[MDI_HEADER]
FILE_TYPE = 'tir'
[UNITS]
LENGTH = 'meter'
FORCE = 'newton'
[DIMENSION]
UNLOADED_RADIUS = 0.745  $Free tyre radius
[VERTICAL]
FNOMIN = 3.4D+04
VERTICAL_STIFFNESS = 7.9e5
VERTICAL_DAMPING = 5e3
NOMPRES = 350000
[SHAPE]
1.00 0.00
0.90 1.00
[SCALING_COEFFICIENTS]
LFZO = 1
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.5
PDX1 = 0.85
PDX2 = -0.06
PEX1 = -0.4
PEX2 = 0.3
PEX3 = -0.2
PEX4 = 0.1
PKX1 = 12.0
PKX2 = 0.5
PKX3 = -0.1
PPX1 = -0.3
PPX3 = -0.07
RBX1 = 11.0
RBX2 = -9.0
RCX1 = 0.99
REX1 = -0.3
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = -0.7
PDY2 = 0.09
PEY1 = 0.1
PEY2 = -0.2
PKY1 = -12.0
PKY2 = 2.2
PPY1 = 0.16
PPY2 = 0.8
PPY3 = -0.1
PPY4 = 0.3
RBY1 = 12.0
RBY2 = 5.0
RCY1 = 0.98
[ALIGNING_COEFFICIENTS]
QBZ1 = 9.0
QCZ1 = 1.3
QDZ1 = 0.08
"""


@pytest.fixture
def write(tmp_path):
    def file(more="", text=FILE, name="tyre.tir"):
        path = tmp_path / name
        path.write_text(text + more, encoding="utf-8")
        return path

    return file


def machine_file(folder, tyre):
    file = folder / "machine.toml"
    file.write_text(f'base = "l60"\nname = "on another tyre"\n[tyre]\n{tyre}\n', encoding="utf-8")
    return file


def wheel_of(file):
    """Block of the front left wheel."""
    return parameter_vector(load_machine(file), Surface(), 0.0)[P_WHEELS : P_WHEELS + WHEEL_SIZE].copy()


def agree(machine, coefficients, dpi):
    """Both models over loads and slips of either sign. 1e-9 of the load: the same formula in two programs."""
    vector = parameter_vector(machine, Surface(friction=machine.tyre.nominal_friction), 0.0)
    w = vector[P_WHEELS : P_WHEELS + WHEEL_SIZE]
    kappa, slip = (a.ravel() for a in np.meshgrid(np.linspace(-1.2, 1.2, 25), np.linspace(-0.5, 0.5, 21)))
    for load in machine.tyre.nominal_load * np.array((0.3, 0.8, 1.0, 1.6)):
        curve = stiffness_and_peak(w, 1.0, load)
        ours = np.array([combined_forces(w, load, curve, k, a)[:2] for k, a in zip(kappa, slip, strict=True)])
        theirs = np.column_stack(magic_formula.forces(coefficients, load, kappa, slip, dpi))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * load)


def test_a_machine_on_a_file_has_the_forces_of_the_published_formula(write, tmp_path):
    path = write()
    machine = load_machine(machine_file(tmp_path, 'tir = "tyre.tir"\nfront_pressure_bar = 4.2'))
    assert machine.tyre.radius == 0.745
    assert machine.tyre.nominal_load == 3.4e4
    agree(machine, read_tir(path).numbers, dpi=4.2 / 3.5 - 1.0)
    assert Plant(machine).truth().normal_force.sum() == pytest.approx(machine.mass * 9.81, rel=1e-6)


@pytest.mark.parametrize("how", ["set", "effect"])
def test_carcass_and_radial_stiffness_follow_the_pressure_in_proportion(tmp_path, how):
    """In 1/(length of relaxation) the carcass is what pressure stiffens; set in the sheet or let in by the effect."""
    slopes = "pcfx3 = 0.3\npcfy3 = 0.5\npfz1 = 0.71\n"
    nominal = wheel_of(machine_file(tmp_path, slopes))
    if how == "set":
        blown = wheel_of(machine_file(tmp_path, slopes + "front_pressure_bar = 4.2"))
    else:
        added = "[effects.inflation_pressure]\nfront_bar = 0.7\nrear_bar = 0.0"
        blown = wheel_of(machine_file(tmp_path, slopes + added))
    assert blown[W_PRESSURE] == pytest.approx(0.2)
    for index, slope in (
        (W_LONGITUDINAL_STIFFNESS, 0.3),
        (W_LATERAL_STIFFNESS, 0.5),
        (W_QFZ1, 0.71),
        (W_QFZ2, 0.71),
    ):
        assert blown[index] / nominal[index] == pytest.approx(1.0 + slope * 0.2), index


def test_the_vertical_stiffness_is_the_files(write, tmp_path):
    """At the nominal pressure: k rho."""
    write()
    tyre = load_machine(machine_file(tmp_path, 'tir = "tyre.tir"')).tyre
    assert tyre.nominal_load * tyre.qfz1 * 0.04 / tyre.radius == pytest.approx(7.9e5 * 0.04)
    assert tyre.qfz2 == 0.0


@pytest.mark.parametrize(
    ("more", "group", "named"),
    [
        ("PDY3 = -1.6", "camber", "PDY3"),
        ("PHY1 = 0.004", "shifts", "PHY1"),
        ("QEZ1 = -0.2", "aligning", "QEZ1"),
        ("RVY1 = 0.01", "combined", "RVY1"),
        ("QSY1 = 0.01", "rolling", "QSY1"),
        ("QSX2 = 0.01", "overturning", "QSX2"),
        ("PTX1 = 1.5", "relaxation", "PTX1"),
        ("PPY5 = 0.2", "camber", "PPY5"),
        ("LKX = 0.9", "scaling", "LKX"),
        ("FE_METHOD = 'YES'", "friction_ellipse", "FE_METHOD"),
        ("[DEFLECTION_LOAD_CURVE]\n{pen fz}\n0.0 0.0\n0.01 7000.0", "load_curve", "DEFLECTION_LOAD_CURVE"),
    ],
)
def test_what_the_model_lacks_is_refused_unless_left_out(write, more, group, named):
    file = read_tir(write(more))
    assert lacking(file) == {group: [named]}
    with pytest.raises(ConfigurationError, match=rf"lacks {group} \({named}\)"):
        tyre_values(file)
    assert tyre_values(file, [group]) == tyre_values(read_tir(write()))


def test_every_coefficient_belongs_to_one_group_at_most():
    names = [name for group in GROUPS.values() for name in group.split()]
    assert len(names) == len(set(names))
    assert not set(GROUPS) & set(MACHINERY)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (FILE.replace("'meter'", "'mm'"), r"\[UNITS\] LENGTH = 'mm'; only meter"),
        (FILE + "\n0.0 x\n", r"tyre.tir:\d+: '0.0 x' is neither KEY = VALUE nor a row of numbers"),
        (FILE.replace("FNOMIN", "FNOM"), "has no FNOMIN: is it a tyre property file"),
    ],
)
def test_a_tyre_file_that_cannot_be_read_is_refused_with_the_reason(write, text, message):
    with pytest.raises(ConfigurationError, match=message):
        tyre_values(read_tir(write(text=text)))


@pytest.mark.parametrize(
    ("tyre", "message"),
    [
        ('tir = "none.tir"', "none.tir: cannot be read"),
        ('tir = "tyre.tir"\nleave_out = ["colour"]', "'colour' is not one of camber"),
        ('tir = "tyre.tir"\nleave_out = "camber"', "tyre.leave_out = 'camber' is not a list"),
        ('tir = "tyre.tir"\npkx9 = 1.0', "tyre.pkx9 is not a known key"),
    ],
)
def test_a_wrong_tyre_table_is_refused_with_the_reason(write, tmp_path, tyre, message):
    write()
    with pytest.raises(ConfigurationError, match=message):
        load_machine(machine_file(tmp_path, tyre))


def test_a_value_of_the_file_cannot_be_set_beside_it(write, tmp_path):
    write()
    file = machine_file(tmp_path, 'tir = "tyre.tir"')
    assert load_machine(file).tyre.pcx1 == 1.5
    with pytest.raises(ConfigurationError, match=r"tyre.pcx1 comes from .*tyre.tir"):
        load_machine(file, [(("tyre", "pcx1"), 1.4)])
    assert load_machine(file, [(("tyre", "rear_pressure_bar"), 3.0)]).tyre.rear_pressure == 3.0


@pytest.mark.data
@pytest.mark.parametrize("psi", [40, 60, 70, 95])
def test_published_truck_tyre_files(recordings, tmp_path, psi):
    """Files of Project Chrono; lateral combined slip has no coefficients there, so its weight is 1."""
    path = Path(recordings) / "chrono_feda_tyre" / f"335_65R22_5_G275MSA_{psi}psi.tir"
    groups = ["camber", "shifts", "aligning", "friction_ellipse", "load_curve"]
    quoted = ", ".join(f'"{group}"' for group in groups)
    machine = load_machine(machine_file(tmp_path, f'tir = "{path}"\nleave_out = [{quoted}]'))
    agree(machine, read_tir(path).numbers, dpi=0.0)
    assert sorted(lacking(read_tir(path))) == sorted(groups)
