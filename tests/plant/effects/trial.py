"""Machines with one effect on, and what they do in simple trials."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from plant.effects import find_effect
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.parameters import P_WHEELS, W_SPIN, WHEEL_SIZE
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

L60 = load_machine("l60")
MASS = 11842.0  # curb, of the machine's sheet [kg]
GRAVITY = 9.81


def machine(name=None, **values):
    """The L60, with an effect."""
    return L60 if name is None else replace(L60, effects=(find_effect(name).of(**values),))


def strong(given):
    """With a relief that never opens: on the spot with locked brakes the tyres take more than the steering's own gives."""
    return replace(given, steering=replace(given.steering, relief_pressure=1e9))


def run(plant, seconds, commands=None, every=0.01):
    """Columns of the truth over a stretch with constant commands."""
    rows = []
    for _ in range(round(seconds / every)):
        plant.advance(commands or Commands(), every)
        rows.append(plant.truth())
    return SimpleNamespace(
        **{key: np.array([getattr(row, key) for row in rows]) for key in type(rows[0]).fields}
    )


def coast(given, speed, seconds=1.0, settle=2.0, **options):
    """Mean acceleration [m/s²] and speed [m/s] of a machine that rolls freely."""
    plant = Plant(given, speed=speed, **options)
    run(plant, settle)
    seen = run(plant, seconds)
    slope = (seen.speed[-1] - seen.speed[0]) / (seen.time_s[-1] - seen.time_s[0])
    return slope, float(seen.speed.mean())


def rolling_mass(radius=0.73, extra=0.0):
    """Mass with what turns with the wheels [kg]."""
    return MASS + 4.0 * (L60.wheel.spin_inertia + extra) / radius**2


def evaluated(plant, given=None):
    """The equations of motion at the plant's present state, with the effects of another machine if one is given.

    Own states of the effects are zero unless the plant has them.
    """
    state, p, work, active, _ = plant.inside()
    if given is not None:
        _, p, work, active, _ = Plant(given, speed=1.0).inside()
    derivative(state, plant._command, p, 0.0, work, active)
    return SimpleNamespace(work=work, p=p, state=state)


def wrenches(seen):
    """Moment and force of every tyre about the joint, (4, 6)."""
    return seen.work.tyres[:, s.T_WRENCH : s.T_WRENCH + 6].copy()


def spin_inertia(p):
    """Spin inertia of each wheel."""
    return p[P_WHEELS + W_SPIN :: WHEEL_SIZE][:4]
