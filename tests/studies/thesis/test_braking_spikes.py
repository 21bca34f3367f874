"""The claims of docs/thesis/braking-spikes.md, and the transducer in the hub against its free body."""

import math

import numpy as np
import pytest

from plant.unit.unit import TICK_S
from studies.thesis.braking_spikes import ASPHALT, CASES, SLIPPERY, measure
from studies.thesis.split import SHEET, SPLITS, machine_of
from studies.thesis.transducer import hub_reading, with_tare


@pytest.fixture(scope="module")
def runs():
    return {case: measure(case) for case in CASES}


def test_on_asphalt_the_trunnion_taken_for_a_pin_costs_two_fifths(runs):
    """(Z - Z_R/2) over Z + h_a m_a/m + 4 J_w/(R m) of the sheet's lumps: Z 1.146, Z_R 0.80, h_a 0.70 m, 1442 of 10 400 kg, 110 kg m2."""
    height = (4382 * 0.962 + 6018 * 1.28) / 10_400
    share = (height - 0.4) / (height + 0.7 * 1442 / 10_400 + 4 * 110 / 0.743 / 10_400)
    assert runs[ASPHALT].held("printed") == pytest.approx(share, abs=0.06)
    assert runs[ASPHALT].held("trunnion") == pytest.approx(1.0, abs=0.15)


def test_the_rocking_is_not_in_a_quasi_static_estimate(runs):
    run = runs[ASPHALT]
    after = (run.truth["time_s"] > 6.0) & (run.truth["time_s"] < 8.0)
    assert np.ptp(run.transfer("plant")[after]) > 15e3
    assert np.ptp(run.transfer("printed")[after]) < 2e3
    assert run.rebound("printed") < 0.7


def test_with_the_wheels_locked_it_sees_nothing_of_the_transfer(runs):
    run = runs[SLIPPERY]
    assert run.locked_s > 1.0
    assert runs[ASPHALT].locked_s == 0.0
    assert abs(run.held("printed")) < 0.1


@pytest.mark.parametrize("case", CASES)
def test_corrected_it_follows_spike_transfer_and_rebound(runs, case):
    run = runs[case]
    assert run.peak("corrected") == pytest.approx(1.0, abs=0.1)
    assert run.held("corrected") == pytest.approx(1.0, abs=0.05)
    assert run.rebound("corrected") == pytest.approx(1.0, abs=0.12)
    assert all(run.rms("corrected", wheel) < 0.15 * run.rms("printed", wheel) for wheel in range(4))


@pytest.mark.parametrize("split", [SPLITS[4], SPLITS[8]], ids=str)
def test_it_misses_whatever_the_split(split):
    run = measure(ASPHALT, split)
    assert run.held("printed") < 0.7
    assert run.held("corrected") == pytest.approx(1.0, abs=0.05)


def moved(deflection):
    force = np.tile(30e3, (len(deflection), 4))
    return {"normal_force": force, "tyre_deflection": np.tile(deflection[:, None], (1, 4))}


def test_a_hub_at_rest_reads_the_load_without_its_wheel():
    machine = machine_of(SHEET)
    reading = hub_reading(moved(np.full(50, 0.05)), machine)
    assert 30e3 - reading == pytest.approx(np.full((50, 4), 426.0 * 9.81))
    assert with_tare(reading, machine) == pytest.approx(np.full((50, 4), 30e3))


def test_a_wheel_thrown_up_takes_its_inertia_from_the_ground_and_not_from_the_hub():
    """Deflection A sin wt: the centre falls by it, so that a = A w2 sin wt upwards and the hub reads m_w a less."""
    time = np.arange(0.0, 2.0, TICK_S)
    w, size = 2 * math.pi * 2.0, 0.01
    reading = hub_reading(moved(size * np.sin(w * time)), machine_of(SHEET))[5:-5, 0]
    upward = size * w * w * np.sin(w * time)[5:-5]
    assert reading == pytest.approx(30e3 - 426.0 * (9.81 + upward), abs=0.02 * 426.0 * size * w * w)
