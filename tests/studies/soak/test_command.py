"""The results of a soak for machines: what fails it is a failure, what stays open is skipped."""

from collections import Counter

from hil.verdict import Result
from studies.soak.command import suite_of
from studies.soak.soak import Soak


def results(**fields):
    found = Soak(1, simulated_s=10.0, states=Counter())
    for name, value in fields.items():
        setattr(found, name, value)
    return [case.result for case in suite_of(found).cases]


def test_a_clean_soak_passes_and_an_empty_one_does_not():
    assert results() == [Result.PASSED, Result.PASSED]
    assert results(simulated_s=0.0)[0] is Result.FAILED


def test_unexplained_detections_on_a_starved_host_decide_nothing():
    three = type(Soak(1).unexplained)()
    three.count = 3
    assert results(unexplained=three)[1] is Result.FAILED
    assert results(unexplained=three, doubt="the host was starved")[1] is Result.INCONCLUSIVE
