"""A rig's files: the same log in every format, good errors, and a result that plant and ECU run with."""

import json
from dataclasses import replace

import numpy as np
import pytest

from configuration import ConfigurationError
from ecu.calibration import load_calibration
from identify.make.defects import Defects
from identify.make.rig import Plan, make_rig
from identify.reading import BadRecording
from identify.results import as_json, rig_machine, tyre_file
from identify.rig.chain import Prepared, fitted, prepare, problem_of
from identify.rig.files import read_rig, write_rig
from identify.rig.models import simulated
from identify.rig.relaxation import step_lengths
from identify.tyre.advice import undetermined
from identify.tyre.curve import force_and_slope
from identify.tyre.estimate import estimate
from identify.tyre.parameters import curve, vector
from plant.sheets.machine import load_machine
from plant.sheets.tyre_file import read_tir

SMALL = Plan(piston_bar=(1.0, 3.0), inflation_bar=(), repeats=1, steps_bar=(1.0,))


@pytest.fixture(scope="module")
def made():
    return make_rig(load_machine("l60"), 11, None, SMALL)


@pytest.fixture(scope="module")
def ready(made) -> Prepared:
    return prepare(made[0])


@pytest.fixture(scope="module")
def found(ready):
    return fitted(ready)


@pytest.mark.parametrize("kind", ["parquet", "csv", "mat"])
def test_a_log_reads_back_as_it_was_written(tmp_path, made, kind):
    log = replace(made[0], runs=made[0].runs[:2])
    read = read_rig(write_rig(log, tmp_path, kind)[0])
    for before, after in zip(log.runs, read.runs, strict=True):
        assert (after.name, after.kind) == (before.name, before.kind)
        for channel in ("time", "cylinder_speed", "force", "shaft_speed"):
            np.testing.assert_allclose(getattr(after, channel), getattr(before, channel), rtol=1e-12)
    assert read.calibration.loaded_radius == pytest.approx(log.calibration.loaded_radius)
    assert read.nominal == log.nominal


@pytest.mark.parametrize(
    ("old", "new", "error", "words"),
    [
        ("V_cyl [m/s]", "V_cyl [N]", BadRecording, "needs m/s"),
        ("V_cyl [m/s]", "speed [m/s]", BadRecording, "has no column 'V_cyl'"),
        ("V_cyl [m/s]", "V_cyl", BadRecording, "has no unit"),
        ("time [s]", "stamp", BadRecording, "no time column"),
    ],
)
def test_a_wrong_heading_is_named(tmp_path, made, old, new, error, words):
    description = write_rig(replace(made[0], runs=made[0].runs[:1]), tmp_path, "csv")[0]
    (file,) = (tmp_path / "runs").iterdir()
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(error, match=words):
        read_rig(description)


def test_a_misspelt_key_of_the_description_is_refused(tmp_path, made):
    description = write_rig(replace(made[0], runs=made[0].runs[:1]), tmp_path, "csv")[0]
    description.write_text(description.read_text().replace("gain_sd_percent", "gain_sd_procent"))
    with pytest.raises(ConfigurationError, match="gain_sd_procent"):
        read_rig(description)


def test_plant_and_ecu_take_the_result(tmp_path, ready, found):
    files = rig_machine(ready, found, "l60", tmp_path / "machine.toml", "a test")
    for path, text in files.items():
        path.write_text(text)
    machine = load_machine(tmp_path / "machine.toml")
    assert machine.tyre.pkx1 == pytest.approx(found.values["PKX1"])
    assert machine.tyre.longitudinal_stiffness == pytest.approx(found.values["carcass stiffness"])
    assert load_calibration(tmp_path / "machine.calibration.toml") is not None
    (tmp_path / "tyre.tir").write_text(tyre_file(ready, found, "a test"))
    assert read_tir(tmp_path / "tyre.tir").numbers["PKX1"] == found.values["PKX1"]
    content = json.loads(as_json(ready, found, undetermined(found, problem_of(ready)), "a test"))
    assert content["parameters"]["PCX1"]["lower"] < content["parameters"]["PCX1"]["upper"]


def test_relaxation_falls_with_slip_and_is_within_ten_percent_of_the_law(made, ready):
    log, truth = made
    (trace,) = [t for t in ready.traces if t.kind == "steps"]
    load = truth.loads[trace.name]
    c, _, _ = curve(vector(truth.tyre), log.nominal, load, log.nominal.pressure)
    lengths = step_lengths(trace, load)
    assert len(lengths) >= 6
    errors = []
    for s in lengths:
        # the length during a step is between those at its two ends, so that the mean slip's is compared
        wanted = force_and_slope(c, s.slip, np.empty(7), np.empty(7))[1] / truth.carcass_stiffness
        errors.append((s.length - wanted) / max(s.length_sd, 0.1 * wanted))
    assert np.sqrt(np.mean(np.square(errors))) < 2.0
    small = [s.length for s in lengths if s.slip < 0.03]
    large = [s.length for s in lengths if s.slip > 0.06]
    assert np.mean(small) > 1.2 * np.mean(large)


def test_validation_run_is_predicted_from_its_slip_alone(ready, found):
    (trace,) = ready.validation
    error = (simulated(problem_of(ready), trace, dict(found.values)) - trace.force)[trace.kept]
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.nanmax(trace.force)


def test_parameters_of_pressure_are_left_out_without_a_second_pressure(ready, found):
    assert not any(name.startswith("PP") for name in found.names)


def test_a_single_small_ramp_leaves_the_shape_undetermined():
    log, _ = make_rig(load_machine("l60"), 3, None, replace(SMALL, piston_bar=(1.0,), validation=False))
    runs = [r for r in log.runs if r.kind != "brake"]
    end = {"drive": 6.0, "steps": 60.0}  # seconds: the ramp has not passed 10 % of slip
    short = [
        replace(
            r,
            **{
                f: getattr(r, f)[r.time < end[r.kind]]
                for f in ("time", "cylinder_speed", "force", "shaft_speed")
            },
        )
        for r in runs
    ]
    ready = prepare(replace(log, runs=short))
    problem = problem_of(ready, ("PCX1", "PDX1", "PEX1", "PKX1"))
    opened = {o.name for o in undetermined(estimate(problem), problem)}
    assert "PEX1" in opened


def test_defects_can_be_switched_off():
    machine = load_machine("l60")
    clean, _ = make_rig(machine, 1, Defects(frozenset()), replace(SMALL, piston_bar=(1.0,)))
    assert all(
        np.isfinite(getattr(r, c)).all()
        for r in clean.runs
        for c in ("force", "cylinder_speed", "shaft_speed")
    )
    dirty, _ = make_rig(machine, 1, Defects(frozenset({"dropouts"})), replace(SMALL, piston_bar=(1.0,)))
    assert any(np.isnan(r.force).any() for r in dirty.runs)
