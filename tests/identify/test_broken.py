"""Input that the chains cannot repair: twenty kinds, each reported, none fitted in silence."""

from dataclasses import replace

import numpy as np
import pytest

from identify.field.chain import Unusable as FieldUnusable
from identify.field.chain import processed
from identify.make.field import make_field
from identify.make.rig import Plan, make_rig
from identify.rig.chain import prepare
from identify.rig.preparing import Unusable
from plant.sheets.machine import load_machine

PLAN = Plan(piston_bar=(1.0,), inflation_bar=(), repeats=2, steps_bar=(), validation=False)
CHANNELS = ("time", "cylinder_speed", "force", "shaft_speed")


@pytest.fixture(scope="module")
def log():
    return make_rig(load_machine("l60"), 21, None, PLAN)[0]


@pytest.fixture(scope="module")
def field():
    return make_field(load_machine("l60"), 5)[0]


def changed(log, **how):
    """The log with the first run's channels replaced: by name, a function of the run."""
    first = replace(log.runs[0], **{name: make(log.runs[0]) for name, make in how.items()})
    return replace(log, runs=[first, *log.runs[1:]])


def reported(log):
    """What the preparation says, and the names of the runs that it would fit."""
    ready = prepare(log)
    return " ".join([*ready.unusable, *ready.warnings, *ready.rejected]), {t.name for t in ready.traces}


RIG = {
    "no sample of the force": (lambda r: {"force": lambda run: np.full(run.force.size, np.nan)}, "force"),
    "dead shaft speed": (lambda r: {"shaft_speed": lambda run: np.zeros(run.time.size)}, "shaft"),
    "shaft with the wrong sign": (lambda r: {"shaft_speed": lambda run: -run.shaft_speed}, "does not turn forwards"),
    "cylinder that stands": (lambda r: {"cylinder_speed": lambda run: 1e-3 * np.sin(run.time * 99.0)}, "stands at the start"),
    "stamps that go back": (lambda r: {"time": lambda run: np.where(run.time > 5.0, run.time - 3.0, run.time)}, "do not ascend"),
    "stamps that repeat": (lambda r: {"time": lambda run: np.where(np.arange(run.time.size) == 900, run.time - 0.002, run.time)}, "do not ascend"),
    "rows left out": (lambda r: {"time": lambda run: run.time + 2.0 * (run.time > 4.0)}, "uneven"),
    "another gear": (lambda r: {"shaft_speed": lambda run: 1.9 * run.shaft_speed}, "another gear"),
    "force in kN": (lambda r: {"force": lambda run: 1e3 * run.force}, "beyond friction"),
    "start under load": (lambda r: {"shaft_speed": lambda run: run.shaft_speed * (1.0 + 0.2 * np.clip(1.0 - run.time, 0.0, 1.0))}, "begin under load"),
    "stuck force": (lambda r: {"force": lambda run: np.where(run.time > 6.0, 4321.0, run.force)}, "stands still"),
    "a few seconds of rows": (lambda r: {name: lambda run, name=name: getattr(run, name)[:150] for name in CHANNELS}, "150 samples"),
}  # fmt: skip


@pytest.mark.parametrize("kind", RIG)
def test_a_broken_run_of_a_rig_is_reported(log, kind):
    how, words = RIG[kind]
    text, _ = reported(changed(log, **how(log)))
    assert words in text


CALIBRATION = {
    "one reading": (
        lambda c: replace(c, piston_pressure=c.piston_pressure[:1], loaded_radius=c.loaded_radius[:1]),
        "make no line",
    ),
    "diameters for radii": (
        lambda c: replace(c, loaded_radius=2.0 * c.loaded_radius),
        "radius or the diameter",
    ),
    "columns in the other order": (
        lambda c: replace(c, loaded_radius=c.loaded_radius[::-1]),
        "columns of the calibration exchanged",
    ),
}


@pytest.mark.parametrize("kind", CALIBRATION)
def test_a_broken_calibration_ends_the_identification(log, kind):
    how, words = CALIBRATION[kind]
    with pytest.raises(Unusable, match=words):
        prepare(replace(log, calibration=how(log.calibration)))


def test_a_reading_of_the_calibration_that_is_wrong_is_reported(log):
    radius = log.calibration.loaded_radius.copy()
    radius[2] += 0.01
    text, _ = reported(replace(log, calibration=replace(log.calibration, loaded_radius=radius)))
    assert "one of them wrong" in text


FIELD = {
    "never inside the scope": (lambda f: replace(f, vicon=replace(f.vicon, y=np.zeros(f.vicon.y.size))), "never inside"),
    "dead encoder": (lambda f: replace(f, somat=replace(f.somat, angle=np.full(f.somat.angle.size, 0.1))), "is it dead"),
    "transducer of another drive": (lambda f: replace(f, somat=replace(f.somat, angle=np.angle(np.exp(1j * 0.02 * f.somat.time**2)))), "events"),
    "transducer's stamps go back": (lambda f: replace(f, somat=replace(f.somat, time=np.where(f.somat.time > 50.0, f.somat.time - 20.0, f.somat.time))), "do not ascend"),
}  # fmt: skip


@pytest.mark.parametrize("kind", FIELD)
def test_a_broken_field_log_ends_the_identification(field, kind):
    how, words = FIELD[kind]
    with pytest.raises(FieldUnusable, match=words):
        processed(how(field))
