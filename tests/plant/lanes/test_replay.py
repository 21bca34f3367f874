"""Segments side by side replay as they do one after the other, to rounding."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plant.effects import dispatch
from plant.effects.registry import effects
from plant.lanes.replay import replay_in_lanes
from plant.observer import PAYLOAD, Observer
from plant.physics import state as s
from plant.physics.parameters import P_GUARD, P_LIFT, SERVO_RELIEF, parameter_vector
from plant.physics.relief_guard import GUARD
from plant.physics.resting import REST, rest_records
from plant.physics.surface import Surface
from plant.physics.workspace import new_workspace
from plant.plant import Plant
from plant.replay import (
    M_ARTICULATION,
    M_BRAKING,
    M_LIFT,
    M_SPEED,
    M_TILT,
    M_TORQUE,
    M_TURNING,
    MEASURED,
    replay,
    replay_parameters,
)
from plant.sheets.machine import load_machine
from plant.truth import Truth

pytestmark = pytest.mark.timeout(600)  # the first of them compiles

L60 = load_machine("l60")
INTERVAL_S, STEP_S = 0.02, 5e-3
COMPILED = [name for name, effect in effects().items() if dispatch.compiled_hooks(effect)]


def with_effects(*names):
    """The L60 with effects of typical size."""
    return replace(L60, effects=tuple(effects()[name].typical() for name in names))


def driven(lengths, seed=1):
    """Measurements of made-up drives (n, MEASURED), one after the other: torque, steering, levers and brakes go up and down."""
    rng, parts = np.random.default_rng(seed), []
    for length in lengths:
        t, m = INTERVAL_S * np.arange(length), np.zeros((length, MEASURED))
        swing = [np.sin(rng.uniform(0.5, 3.0) * t + rng.uniform(0, 6)) for _ in range(4)]
        m[:, M_TORQUE : M_TORQUE + 4] = 600.0 + 2500.0 * swing[0][:, None]
        m[:, M_BRAKING] = swing[3] > 0.8
        m[:, M_SPEED] = 4.0 + 1.5 * swing[0]
        m[:, M_TURNING : M_TURNING + 4] = m[:, M_SPEED, None]
        for at, wave, size in (
            (M_ARTICULATION, swing[1], 0.4),
            (M_LIFT, swing[2], 0.5),
            (M_TILT, swing[3], 0.2),
        ):
            m[:, at] = size * wave
            m[:, at + 1] = np.gradient(m[:, at], INTERVAL_S) if length > 1 else 0.0
        parts.append(m)
    return np.concatenate(parts), np.concatenate(([0], np.cumsum(lengths)))


def both(lengths, machine=L60, *, demanded=(False, False, False), seed=1, change=None, rested=True):
    """Rows and states of the replay one by one and in lanes."""
    measured, edges = driven(lengths, seed)
    p = replay_parameters(parameter_vector(machine, Surface(), 2000.0), STEP_S, demanded=demanded)
    active = dispatch.active_vector(machine.effects)
    if change is not None:
        change(p)
    starts = np.array(
        [Plant(machine, payload_mass=2000.0, speed=2.0 + 0.1 * i).inside()[0] for i in range(len(lengths))]
    )
    rests = np.zeros((0, REST))
    if rested:
        rests = np.empty((len(lengths), REST))
        rest_records(starts, p, new_workspace(), active, rests)
        p[:1] *= 1.1  # a heavier rear frame than that of the starts
    found = []
    for function in (replay, replay_in_lanes):
        rows, states = (
            np.full((len(measured), Truth.size), np.nan),
            np.full((len(measured), s.STATES), np.nan),
        )
        function(
            starts.copy(), rests, measured, edges, p, demanded, STEP_S, round(INTERVAL_S / STEP_S), new_workspace(), active,
            Observer(machine, 2000.0).measures, rows, states,
        )  # fmt: skip
        rows[:, PAYLOAD] = 0.0
        found.append((rows, states))
    return found


def assert_same(found, within=1e-11):
    """Rows and states agree to `within` of the largest value of each column: rounding, in some hundred steps; 2e-13 was measured."""
    for one, other in zip(*found, strict=True):
        assert np.array_equal(np.isfinite(one), np.isfinite(other))
        size = np.nanmax(np.abs(one), axis=0)
        assert np.nanmax(np.abs(one - other) / (size + 1e-6)) < within


@pytest.mark.parametrize("lengths", [(40,), (30, 50), (25, 60, 10, 35), (20, 45, 5, 30, 15, 2, 40, 1, 33)])
@pytest.mark.parametrize("rested", [True, False])
def test_segments_of_any_number_and_length(lengths, rested):
    found = both(lengths, rested=rested)
    assert np.isfinite(found[0][0]).all()
    assert_same(found)


def test_demands_in_place_of_rates():
    assert_same(both((30, 40, 20, 50, 10), demanded=(True, True, False)))


@pytest.mark.parametrize("name", COMPILED)
def test_every_effect(name):
    machine = with_effects(name)
    assert_same(both((25, 30, 20, 35, 10), machine))


def test_two_effects_together():
    machine = with_effects("rolling_resistance", "frame_torsion", "washboard")
    assert_same(both((25, 30, 20, 35, 10), machine))


def test_lanes_whose_relief_valves_open():
    """These steps are computed alone: the lift cylinder cannot hold its load."""

    def weak(p):
        p[P_LIFT + SERVO_RELIEF] = 5e5
        p[P_GUARD : P_GUARD + GUARD] = (
            math.nan
        )  # the bounds of another relief; where there are none, every step is looked at

    lengths, demanded = (80, 60, 90, 75, 85), (True, True, True)
    plain, weakened = both(lengths, demanded=demanded), both(lengths, demanded=demanded, change=weak)
    assert_same(weakened)
    angle = Truth.lift_arm_angle.at
    assert np.abs(plain[0][0][:, angle] - weakened[0][0][:, angle]).max() > 0.05  # the valves did open


def test_a_motion_that_diverges_leaves_its_neighbours_alone():
    measured, edges = driven((30, 30, 30, 30, 30))
    p = replay_parameters(parameter_vector(L60, Surface(), 0.0), STEP_S, demanded=(False, False, False))
    starts = np.array([Plant(L60, speed=2.0).inside()[0]] * 5)
    rows = [np.full((150, Truth.size), np.nan) for _ in range(2)]
    for broken, found in zip((False, True), rows, strict=True):
        given = measured.copy()
        if broken:
            given[35:60, M_TORQUE] = np.nan
        replay_in_lanes(
            starts.copy(), np.zeros((0, REST)), given, edges, p, (False, False, False), STEP_S, 4, new_workspace(), None,
            Observer(L60, 0.0).measures, found, np.zeros((0, s.STATES)),
        )  # fmt: skip
    good = np.r_[0:30, 60:150]
    np.testing.assert_array_equal(rows[0][good], rows[1][good])
    assert np.isnan(rows[1][40:60, Truth.speed.at]).all()
