"""What is beyond a bound, and where rounding decides it: the judging of a build in single precision, on frames of our own."""

from bench.single_precision import NEAR, Difference, Judged, difference_of, estimates, stretches
from dbc import loader_database

DATABASE = loader_database()


def frame(message, **values):
    codec = DATABASE.by_name[message]
    return codec.can_id, bytes(codec.encode_dict(dict.fromkeys(codec.by_signal, 0.0) | values))


def beyond(*ticks, name="RollOver.State"):
    found = Difference()
    found.beyond[name] += ticks
    return found


def test_an_estimate_may_be_off_by_one_step_and_a_choice_by_none():
    step = DATABASE.by_name["TurningTorque"].by_signal["YawMoment"].scale
    theirs = [[frame("TurningTorque", YawMoment=1.0)]] * 3
    ours = [[frame("TurningTorque", YawMoment=1.0 + k * step, TorqueValid=k == 1)] for k in (0, 1, -2)]
    found = difference_of(ours, theirs)
    assert found.within == {"TurningTorque.YawMoment": 1}
    assert found.beyond == {"TurningTorque.YawMoment": [2], "TurningTorque.TorqueValid": [1]}


def test_every_estimate_has_many_steps_and_none_is_a_limit():
    names = list(estimates())
    assert {"NormalForces.FrontLeft", "BodyMotion.PayloadMass", "RollOver.LoadTransferRatio"} <= set(names)
    assert not any(name.startswith(("Limits.", "EcuStatus.", "ActiveFaults.")) for name in names)
    assert "RollOver.PredictedLoadTransferRatio" not in names


def test_a_stretch_ends_with_a_long_pause():
    assert list(stretches([])) == []
    assert list(stretches([5])) == [(5, 5)]
    assert list(stretches([5, 6, 6 + NEAR, 7 + 2 * NEAR])) == [(5, 6 + NEAR), (7 + 2 * NEAR, 7 + 2 * NEAR)]


def test_a_stretch_counts_as_a_thresholds_where_a_draw_is_beyond_near_it():
    for tick, explained in (
        (300, True),
        (300 - NEAR, True),
        (310 + NEAR, True),
        (299 - NEAR, False),
        (311 + NEAR, False),
    ):
        done = Judged()
        done.add(1000, beyond(300, 310), [beyond(), beyond(tick)])
        assert done.counts(["RollOver.State"]) == (1, 0 if explained else 1)
        assert done.signals["RollOver.State"].alone == ([] if explained else [(0, 300, 310)])


def test_another_signal_and_another_drive_explain_nothing():
    done = Judged()
    done.add(1000, beyond(), [beyond(300)])
    done.add(1000, beyond(300), [beyond(300, name="RollOver.LiftingWheel")])
    assert done.counts(["RollOver.State"]) == (1, 1)
