"""Rig chain: load line, scale factor, steps, and a tyre recovered inside its intervals."""

import numpy as np
import pytest

from identify.make.defects import Defects
from identify.make.rig import Plan, make_rig
from identify.rig.load import load_line
from identify.rig.log import PistonCalibration
from identify.rig.preparing import Unusable, kind_of, prepared, steps
from identify.tyre.estimate import estimate
from identify.tyre.parameters import Nominal
from identify.tyre.rig_problem import CARCASS_NAME, RigProblem
from plant.sheets.machine import load_machine

TYRE = ("PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX4", "PKX1", "PKX3", "PPX1", "PPX2", "PPX3", "PPX4")


@pytest.fixture(scope="module")
def made():
    return make_rig(load_machine("l60"), 4)


@pytest.fixture(scope="module")
def line(made):
    return load_line(made[0].calibration, made[0].nominal)


@pytest.fixture(scope="module")
def traces(made, line):
    return [prepared(run, line.load(run.piston_pressure)) for run in made[0].runs]


def test_load_line_is_that_of_table_8():
    nominal = Nominal(load=34e3, pressure=3.5e5, radius=0.743)
    loads = np.array([29.0, 33.8, 38.6, 43.4, 48.2]) * 1e3
    depth = (-13.7 + np.sqrt(13.7**2 + 4.0 * 27.6 * loads / 34e3)) / (2.0 * 27.6)
    c = PistonCalibration(
        piston_pressure=np.arange(5.0) * 1e5,
        loaded_radius=0.743 * (1.0 - depth),
        radius_sd=1e-3,
        q1=13.7,
        q2=27.6,
        stiffness_sd=0.02,
    )
    found = load_line(c, nominal)
    assert found.line == pytest.approx([29e3, 4.8e3], rel=1e-6)
    assert found.sd(1e5) == pytest.approx(np.hypot(0.02 * 33.8e3, 450.0), rel=0.2)


@pytest.mark.parametrize("kind", ["drive", "brake", "steps", "validation"])
def test_kind_of_a_run_shows_in_its_signals(traces, kind):
    for trace in traces:
        if trace.kind == kind:
            assert kind_of(trace.speed, trace.wheel) == kind


def test_scale_factor_is_within_its_doubt(made, traces):
    away = np.array([t.scale / made[1].scale - 1.0 for t in traces])
    assert np.max(np.abs(away)) < 2e-3  # the prior of the fit


def test_steps_of_the_cylinder_are_found(traces):
    (trace,) = [t for t in traces if t.name.startswith("steps_pc1")]
    assert np.array(steps(trace.speed)) * trace.step == pytest.approx(6.0 * np.arange(1, 9), abs=0.6)


def test_damage_is_counted_with_its_reason(traces):
    reasons = {reason for t in traces for reason in t.rejected}
    assert {"force: spike", "force: not recorded", "cylinder_speed: spike"} <= reasons


def test_tyre_is_recovered_inside_its_intervals(made, line, traces):
    log, truth = made
    problem = RigProblem(
        traces=[t for t in traces if t.kind != "validation"],
        nominal=log.nominal,
        loads=line,
        tyre=TYRE,
        gain_sd=log.gain_sd,
    )
    found = estimate(problem)
    away = [abs(found.values[n] - truth.tyre[n]) / found.interval(n).sd for n in TYRE]
    assert max(away) < 4.0
    assert np.sqrt(np.mean(np.square(away))) < 1.7
    assert found.values[CARCASS_NAME] == pytest.approx(truth.carcass_stiffness, rel=0.1)


def test_without_defects_the_tyre_is_almost_exact():
    machine = load_machine("l60")
    log, truth = make_rig(
        machine,
        5,
        Defects(frozenset()),
        Plan(piston_bar=(1.0, 4.0), inflation_bar=(), repeats=1, steps_bar=(1.0,), validation=False),
    )
    loads = load_line(log.calibration, log.nominal)
    traces = [prepared(run, loads.load(run.piston_pressure)) for run in log.runs]
    problem = RigProblem(
        traces=traces,
        nominal=log.nominal,
        loads=loads,
        tyre=("PCX1", "PDX1", "PEX1", "PKX1"),
        fixed={"PDX2": -0.05, "PKX3": -0.12},
        gain_sd=0.0,
    )
    found = estimate(problem)
    for name in ("PCX1", "PDX1", "PEX1", "PKX1"):
        assert found.values[name] == pytest.approx(
            truth.tyre[name], rel=5e-3
        )  # what averaging to 100 Hz costs


def test_a_run_that_begins_standing_is_refused(made):
    from dataclasses import replace

    run = made[0].runs[0]
    with pytest.raises(Unusable, match="stands at the start"):
        prepared(
            replace(run, cylinder_speed=run.cylinder_speed * 0.0 + 0.001 * np.sin(run.time * 50.0)), 34e3
        )
