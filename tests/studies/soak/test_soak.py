"""A soak is repeatable, keeps its promises on the real ECU, and finds an ECU that breaks them."""

import itertools
import math
import random
from dataclasses import replace

import pytest

from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.states import State
from hil import ecu_side
from hil.faults.table import KINDS, SECOND
from hil.lockstep import PERIOD_NS
from hil.verdict import Result
from studies.soak import chance, watch
from studies.soak.document import classes, page
from studies.soak.soak import AFTERWARDS_S, Happened, Keeper, Soak, soak
from studies.soak.watch import Answer, Mechanism, Witness
from tests.hil.faults.traffic import fault

SECONDS, SEED = (
    14.0,
    14,
)  # its first fault is signed payloads of any content, in five of a hundred frames from the plant
GOOD = dict.fromkeys(loader_database().by_name["Limits"].signals, 1.0)


@pytest.fixture(scope="module")
def found():
    return soak(40.0, 5)


def kept(*answers):
    found = Soak(0)
    Keeper(found).check(
        [Answer(n * PERIOD_NS, state, GOOD | limits) for n, (state, limits) in enumerate(answers)]
    )
    return found.violations


def test_forty_seconds_of_faults_passes(found):
    assert found.result is Result.PASSED, (found.violations.lines, found.unexplained.lines)
    assert 40.0 <= found.simulated_s < 41.0
    assert len(found.faults) >= 8
    assert sum(found.states.values()) > 3500


def test_equal_seeds_give_equal_soaks_and_others_do_not(found):
    again = soak(40.0, 5)
    assert again == found
    assert [h.fault.label for h in soak(12.0, 6).faults] != [h.fault.label for h in found.faults[:2]]


def test_faults_of_a_soak_do_not_touch_one_another(found):
    times = [(h.fault.at_ns, h.fault.at_ns + h.fault.for_ns) for h in found.faults]
    for (_, ends), (begins, _) in itertools.pairwise(times):
        assert begins - ends >= AFTERWARDS_S * SECOND


def test_faults_begin_on_a_tick_so_that_the_quiet_before_them_is_quiet(found):
    assert all(h.fault.at_ns % PERIOD_NS == 0 for h in found.faults)


def test_chance_gives_every_kind_and_only_sound_tables():
    generator = random.Random(1)
    kinds = {fault(**chance.fault(generator)).kind for _ in range(500)}
    assert kinds == set(KINDS)


def test_an_ecu_that_divides_by_a_measured_zero_is_found(monkeypatch):
    """It once did: a signed frame of zeros ended its process. The calibration lets zeros in again, and the estimators divide by them."""
    made = watch.ecu_cycle
    unchecked = replace(
        load_calibration(), inputs=replace(load_calibration().inputs, least_specific_force=0.0)
    )

    def dividing(**choices):
        ecu = made(**choices)
        estimate = ecu._estimator.estimate

        def divides(values):
            1.0 / math.hypot(values.specific_force_x, values.specific_force_y, values.specific_force_z)
            return estimate(values)

        ecu._estimator.estimate = divides
        return ecu

    assert soak(SECONDS, SEED).violations.count == 0
    monkeypatch.setattr(watch, "ecu_cycle", dividing)
    monkeypatch.setattr(ecu_side, "load_calibration", lambda name: unchecked)
    found = soak(SECONDS, SEED)
    assert found.result is Result.FAILED
    assert any("in its fault state" in line for line in found.violations.lines)


def test_declared_answers_are_fine():
    assert kept((State.INIT, {}), (State.RUNNING, {}), (State.DEGRADED, {}), (State.RUNNING, {})).count == 0
    assert kept((State.RUNNING, {"FrontLeftTorque": 254 * 0.2})).count == 0  # 50.8 as the codec computes it


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ([(7, {})], "state 7 is not declared"),
        ([(State.FAULT, {})], "in its fault state"),
        ([(State.RUNNING, {}), (State.INIT, {})], "from RUNNING to INIT is not declared"),
        ([(State.RUNNING, {"Speed": 51.1})], "Limits.Speed = 51.1, outside 0..51"),
        ([(State.RUNNING, {"Speed": float("nan")})], "Limits.Speed = nan"),
    ],
)
def test_a_broken_promise_is_named(answers, said):
    violations = kept(*answers)
    assert violations.count == 1
    assert said in violations.lines[0]


def test_a_new_ecu_may_begin_at_init():
    found = Soak(0)
    Keeper(found).check([Answer(0, State.RUNNING, GOOD), Answer(30 * PERIOD_NS, State.INIT, GOOD)])
    assert found.violations.count == 0


def test_classes_count_what_struck_and_what_was_detected():
    drop = fault(kind="drop", message="BodyRates", for_s=1.0)
    by = frozenset({(Witness.ECU, Mechanism.TIMEOUT)})
    happened = [
        Happened(fault=drop, struck=True, detected=by),
        Happened(fault=drop, struck=True, detected=frozenset()),
        Happened(fault=drop, struck=False, detected=frozenset()),
    ]
    (row,) = [c for c in classes(happened) if c.kind == "drop"]
    assert (row.injected, row.struck, row.detected) == (3, 2, 1)
    assert row.by == {(Witness.ECU, Mechanism.TIMEOUT): 1}
    assert row.undetected == ["drop BodyRates"]


def test_the_page_names_seed_command_and_every_class(found):
    text = page(found, "loaderhil soak --hours 0.02 --seed 5")
    assert "`loaderhil soak --hours 0.02 --seed 5`" in text
    assert "seed 5" in text
    assert all(f"| {kind} |" in text for kind in KINDS)


def test_a_soak_that_found_something_says_so():
    found = Soak(1, simulated_s=10.0)
    found.violations.add("drive 1, 3.00 s: state 7 is not declared")
    assert found.result is Result.FAILED
    assert "state 7 is not declared" in page(found, "x")
