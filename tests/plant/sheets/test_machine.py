"""The machine file: masses as published, and errors that say what is wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from configuration import ConfigurationError
from plant.sheets.machine import MACHINES, load_machine
from tests.plant.oracle import statics

TEXT = (MACHINES / "l60.toml").read_text(encoding="utf-8")


def changed(tmp_path: Path, old: str, new: str) -> Path:
    assert TEXT.count(old) == 1, f"{old!r} is not unique in the file"
    path = tmp_path / "other.toml"
    path.write_text(TEXT.replace(old, new), encoding="utf-8")
    return path


def lumped(machine, payload, front):
    """Mass, CoG x and z, principal inertias of one half, from the bodies."""
    tilt = machine.tilt.carry_angle
    parts = statics.bodies(machine, payload, 0.0, machine.lift.carry_angle, tilt, 0.0)
    parts = [(m, c, i) for m, c, i, _ in parts if (c[0] > 0) == front]
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * c for m, c, _ in parts) / mass
    total = sum(
        i + m * (((c - centre) @ (c - centre)) * np.eye(3) - np.outer(c - centre, c - centre))
        for m, c, i in parts
    )
    return mass, centre[0], centre[2], *np.diag(total)


def test_curb_mass():
    assert load_machine("l60").mass == pytest.approx(11842.0)


# machine sheet 1.3, lumped: payload, front half?; mass, x, z, Ixx, Iyy, Izz
@pytest.mark.parametrize(
    ("payload", "front", "expected"),
    [
        (0.0, True, (4382, 1.822, 0.962, 2414, 4253, 5126)),
        (3204.0, True, (7586, 2.442, 0.935, 4050, 8735, 10797)),
        (0.0, False, (7460, -1.238, 1.168, 4003, 6225, 6668)),
    ],
)
def test_lumped_halves_are_those_published(payload, front, expected):
    """0.5 %: the table rounds, and we add 10 kg m2 of hub to each wheel's spin.

    The table adds the arm's own inertias without turning them into the carry position, 188 kg m2
    from Izz to Ixx; turning about y keeps the sum of the two, which is what is compared.
    """
    mass, x, z, ixx, iyy, izz = lumped(load_machine("l60"), payload, front)
    *centre, xx, yy, zz = expected
    np.testing.assert_allclose((mass, x, z), centre, rtol=5e-4)
    np.testing.assert_allclose((ixx + izz, iyy), (xx + zz, yy), rtol=5e-3)


def test_a_path_loads_like_a_name(tmp_path):
    assert load_machine(changed(tmp_path, "track_m = 1.93", "track_m = 1.95")).geometry.track == 1.95


def test_degrees_become_radians():
    assert load_machine("l60").steering.limit == pytest.approx(math.radians(40.0))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 6018", "mass_kg = -6018", ["other.toml", "rear_frame.mass_kg", "-6018", "kg"]),
        ("mass_kg = 6018", 'mass_kg = "heavy"', ["rear_frame.mass_kg", "heavy", "not a number"]),
        ("mass_kg = 6018", "mas_kg = 6018", ["rear_frame.mass_kg", "missing"]),
        ("limit_deg = 40 ", "limit_deg = 400 ", ["steering.limit_deg", "400", "deg", "80"]),
        (
            "track_m = 1.93",
            "track_m = 1.93\ntrack_width_m = 2",
            ["geometry.track_width_m", "not a known key"],
        ),
        ("[brake]", "[brakes]", ["brake", "missing"]),
        ("ixx_kg_m2 = 2570", "ixx_kg_m2 = 25700", ["rear_frame", "inertias", "25700"]),
        ("carry_angle_deg = -37", "carry_angle_deg = -60", ["lift.carry_angle_deg", "-60", "-46..46"]),
        (
            "cushion_time_constant_s = 0.20",
            "cushion_time_constant_s = 0.10",
            ["steering.cushion", "overshoot"],
        ),
        ("pfz1 = 0.71", "pfz1 = nan", ["tyre.pfz1", "nan"]),
        ("[geometry]", "[geometry", ["other.toml", "not valid TOML"]),
    ],
)
def test_one_clear_error(tmp_path, old, new, words):
    with pytest.raises(ConfigurationError) as caught:
        load_machine(changed(tmp_path, old, new))
    for word in words:
        assert word in str(caught.value)


def test_unknown_name_lists_the_known_ones():
    with pytest.raises(ConfigurationError, match="l60"):
        load_machine("l90")
