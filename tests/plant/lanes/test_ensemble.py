"""Machines of an ensemble move as each does alone, to rounding."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from plant.effects.registry import effects
from plant.lanes.ensemble import Ensemble
from plant.physics import state as s
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.truth import Truth
from tests.docs.pages import ROOT, fences

pytestmark = pytest.mark.timeout(600)  # the first of them compiles

L60 = load_machine("l60")


def with_effects(*names):
    """The L60 with effects of typical size."""
    return replace(L60, effects=tuple(effects()[name].typical() for name in names))


def various(count, seed=3):
    """Plants that differ in machine, effects, ground, payload and start."""
    rng, plants = np.random.default_rng(seed), []
    machines = [
        L60,
        with_effects("washboard"),
        with_effects("yaw_inertia"),
        with_effects("frame_torsion", "brake_drag"),
    ]
    for i in range(count):
        heavier = replace(machines[i % 4], name=f"number {i}")
        ground = Surface(grade=0.02 * rng.uniform(-1, 1), friction=rng.uniform(0.5, 0.9))
        plants.append(Plant(heavier, ground, payload_mass=rng.uniform(0, 3000), speed=rng.uniform(1, 4)))
    return plants


def commands_of(count, seed=4):
    """Commands of every machine."""
    rng = np.random.default_rng(seed)
    return np.array(
        [
            Commands(
                wheel_torque=tuple(rng.uniform(-500, 2000, 4)),
                articulation_rate=rng.uniform(-0.3, 0.3),
                lift_rate=rng.uniform(-0.3, 0.3),
                tilt_rate=rng.uniform(-0.3, 0.3),
                brake_torque=tuple(rng.uniform(0, 100, 4)),
            ).vector()
            for _ in range(count)
        ]
    )


@pytest.mark.parametrize("count", [1, 3, 4, 9, 18])
def test_each_machine_moves_as_alone(count):
    plants = various(count)
    ensemble, commands = Ensemble(plants), commands_of(count)
    for duration in (0.05, 0.2, 0.01):
        rows = ensemble.advance(commands, duration)
        alone = np.array([p.advance_by(c, duration).row for p, c in zip(plants, commands, strict=True)])
        size = np.abs(alone).max(axis=0) + 1e-6
        assert (np.abs(rows - alone) / size).max() < 1e-11
        commands = commands[::-1].copy()
    states = np.array([plant.inside()[0] for plant in plants])
    np.testing.assert_allclose(ensemble.states, states, rtol=1e-9, atol=1e-11)


def test_the_plants_it_is_made_of_stay_where_they_are():
    plant = Plant(L60, speed=2.0)
    ensemble = Ensemble([plant])
    ensemble.advance(Commands().vector(), 0.1)
    assert plant.time_s == 0.0
    assert ensemble.states[0, s.POSITION] > plant.inside()[0][s.POSITION] + 0.1


def test_a_machine_that_diverges_leaves_the_others_alone():
    calm = [Plant(L60, speed=2.0 + 0.1 * i) for i in range(3)]
    broken = Plant(L60, speed=2.0)
    broken._state[s.VELOCITY] = 1e200
    rows = Ensemble([calm[0], broken, *calm[1:]]).advance(Commands().vector(), 0.5)
    assert np.isnan(rows[1]).all()
    np.testing.assert_array_equal(rows[[0, 2, 3]], Ensemble(calm).advance(Commands().vector(), 0.5))


@pytest.mark.parametrize(
    ("commands", "duration", "error"),
    [
        (np.zeros(3), 0.01, r"commands have the shape \(3,\), not \(2, 11\) or \(11,\)"),
        (np.full(s.COMMANDS, math.nan), 0.01, "a command is not finite"),
        (np.zeros(s.COMMANDS), 0.0005, "is not a whole number of steps of 0.001 s"),
    ],
)
def test_wrong_commands_are_refused(commands, duration, error):
    with pytest.raises(ValueError, match=error):
        Ensemble([Plant(L60), Plant(L60)]).advance(commands, duration)


def test_plants_that_cannot_go_together_are_refused():
    with pytest.raises(ValueError, match=r"steps differ: 0.001 s, 0.002 s"):
        Ensemble([Plant(L60), Plant(L60, step_s=2e-3)])
    with pytest.raises(ValueError, match="'rk4': an ensemble is semi-implicit"):
        Ensemble([Plant(L60, integrator="rk4")])
    with pytest.raises(ValueError, match="at least one plant"):
        Ensemble([])


def test_time_and_payload_are_in_the_rows():
    rows = Ensemble([Plant(L60, payload_mass=m) for m in (0.0, 500.0)]).advance(Commands().vector(), 0.25)
    assert rows[:, Truth.time_s.at].tolist() == [0.25, 0.25]
    assert rows[:, Truth.payload_mass.at].tolist() == [0.0, 500.0]


def test_the_example_of_the_how_to_runs(capsys):
    [block] = [
        f
        for f in fences((ROOT / "docs" / "howto" / "many-machines.md").read_text())
        if f.language == "python"
    ]
    exec(block.text.replace("range(200)", "range(5)").replace("range(60)", "range(2)"), {})
    assert re.fullmatch(r"\[[\d. ]+\] m\n", capsys.readouterr().out)
