"""The proof's bookkeeping: what counts as right, shares and their intervals, rows that read back, arms that are kept distinct."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from bench.proof import car, report, score
from bench.proof.arm import Arm, Done, Truth, read, row
from bench.proof.plan import BODIES, GROUPS, plan, sampled
from bench.proof.stamps import KINDS, rows
from diagnosis.fleet.store import Store
from discrepancy.estimation.fit import fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Candidate, Findings, Interval, Regime, Where
from tests.diagnosis.cases import finding


def findings(*found, status="explained") -> Findings:
    return Findings(model="m", recordings=["r"], status=status, reasons=[], findings=list(found))


def done(kind="effect", effects=("a",), strength=250.0, reached=250.0, found=(), values=None, **more) -> Done:
    arm = Arm(body="straight", kind=kind, seed=1, effects=effects, strength=strength, **more)
    return Done(arm, Truth(values=values or {}, reached=reached), findings(*found), 1.0)


A, B = finding("a", "physics", {"a": 0.5}), finding("b", "physics", {"b": 0.5})
A_OR_B = finding("b", "physics", {"b": 0.5}, group=("a",))
PROXY = finding("a", "physics", {"a": 0.5}, named=False)


@pytest.mark.parametrize(
    ("run", "right", "found", "first", "falsely"),
    [
        (done(found=(A,)), True, True, True, False),
        (done(found=(A_OR_B,)), True, True, False, False),
        (done(found=(A, B)), False, True, True, True),
        (done(found=(B,)), False, False, False, True),
        (done(found=(PROXY,)), False, False, True, False),
        (done(found=()), False, False, False, False),
        (done(found=(), strength=10.0, reached=10.0), True, False, False, False),
        (done(found=(B,), strength=10.0, reached=10.0), False, False, False, True),
        (done("pair", ("a", "b"), found=(A, B)), True, True, True, False),
        (done("pair", ("a", "b"), found=(A,)), False, False, True, False),
    ],
)
def test_what_counts_as_right(run, right, found, first, falsely) -> None:
    assert (score.right(run), score.found(run), score.first(run), score.falsely(run)) == (
        right,
        found,
        first,
        falsely,
    )


def of_loader(lam: float, **more) -> Done:
    run = done(strength=3.0, reached=lam, **more)
    return replace(run, arm=replace(run.arm, body="loader"))


def test_the_loader_is_judged_by_the_lambda_that_its_sizes_came_to() -> None:
    found, missed = of_loader(60.0, found=(A,)), of_loader(51.0)
    weak, unseen = of_loader(49.0), of_loader(0.0, found=(B,))
    rows = {line.metric: line.measured for line in score.table([found, missed, weak, unseen])}
    assert rows["truth in the reported group, lambda >= 50"].startswith("1 of 2 ")
    assert (score.right(found), score.right(missed), score.right(weak), score.right(unseen)) == (
        True, False, True, False,
    )  # fmt: skip
    assert [line.split(" | ")[1] for line in score.failures([found, missed, weak, unseen])] == [
        "51",
        "49",
        "0",
    ]
    shares = [line.split(" | ")[:3] for line in score.by_strength([found, missed, weak, unseen])][2:]
    assert [(head.removeprefix("| "), arms, of[:6]) for head, arms, of in shares] == [
        ("below 10", "1", "0 of 1"),
        ("10 to 50", "1", "0 of 1"),
        ("50 to 250", "2", "1 of 2"),
        ("250 and more", "0", "none r"),
    ]


@pytest.mark.parametrize("kind", ["null", "outside"])
def test_a_name_where_there_is_none_to_give_is_wrong_and_a_proxy_is_not(kind) -> None:
    assert score.right(done(kind, (), found=(PROXY,)))
    assert not score.right(done(kind, (), found=(A,)))


@pytest.mark.parametrize(
    ("effect", "verdict", "forgiven"),
    [("a", "could not be judged", True), ("a", "ruled out", False), ("b", "could not be judged", False)],
)
def test_a_miss_is_forgiven_where_it_is_said_of_that_effect_that_it_could_not_be_judged(
    effect, verdict, forgiven
) -> None:
    candidate = Candidate(
        effect=effect,
        kind="physics",
        verdict=verdict,
        statistic=0.0,
        p_value=1.0,
        expected=[],
        power=0.0,
        confounded_share=1.0,
        reason="",
    )
    run = done()
    assert score.unjudged(replace(run, findings=replace(run.findings, candidates=[candidate]))) is forgiven


@pytest.mark.parametrize(("difference", "tied"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_rival_as_likely_as_the_first_is_tied_with_it_and_the_first_itself_or_another_is_not(
    difference, tied
) -> None:
    rival = replace(A_OR_B.group[0], likelihood_difference=difference)
    assert score.tied(done(found=(replace(A_OR_B, group=[rival]),))) is tied
    assert score.tied(done(found=(B, replace(A_OR_B, group=[rival])))) is False
    assert score.tied(done(effects=("c",), found=(replace(A_OR_B, group=[rival]),))) is False


@pytest.mark.parametrize(("hits", "of"), [(0, 24), (3, 9), (57, 60), (12, 12)])
def test_intervals_are_those_of_scipy(hits, of) -> None:
    wilson = binomtest(hits, of).proportion_ci(method="wilson")
    np.testing.assert_allclose(score.wilson(hits, of), (wilson.low, wilson.high), atol=1e-12)
    exact = binomtest(hits, of, alternative="less").proportion_ci(method="exact")
    assert score.upper_bound(hits, of) == pytest.approx(exact.high)


def test_errors_and_coverage_are_of_the_effect_under_its_own_name() -> None:
    estimate = finding("a", "physics", {"a": 0.55}, interval=(0.5, 0.6))
    assert list(score.parameters(done(found=(estimate,), values={"a": 0.5}))) == [(pytest.approx(0.1), True)]
    assert next(iter(score.parameters(done(found=(estimate,), values={"a": 0.7}))))[1] is False
    assert list(score.parameters(done(found=(A_OR_B,), values={"a": 0.5}))) == []


def test_places() -> None:
    interval = Interval(recording="r", start_s=20.0, end_s=40.0, share=1.0)
    regime = Regime(text="speed below -1 m/s", share=1.0, density=2.0)
    where = Where(channels={"one": 0.7, "two": 0.3}, throughout=False, intervals=[interval], regimes=[regime])
    interval = done("interval", start_s=30.0, end_s=50.0, found=(replace(A, where=where),))
    assert score.overlap(interval) == pytest.approx(10.0 / 30.0)
    assert score.overlap(done("interval", start_s=30.0, end_s=50.0)) == 0.0
    named = replace(A, where=where)
    for channels, right in (
        ({"one": 0.9, "two": 0.1}, True),
        ({"one": 0.46, "two": 0.54}, True),
        ({"one": 0.1, "two": 0.9}, False),
    ):
        run = done(found=(named,))
        assert score.channel_right(replace(run, truth=replace(run.truth, channels=channels))) is right
    reverse = replace(named, effect="reverse drag")
    assert score.regime_right(done(effects=("reverse drag",), found=(reverse,))) is True
    assert (
        score.regime_right(done(effects=("brake fade",), found=(replace(named, effect="brake fade"),)))
        is False
    )
    assert score.regime_right(done(found=(named,))) is None


def test_a_row_reads_back(tmp_path) -> None:
    arm = Arm(
        body="straight",
        kind="interval",
        seed=3,
        effects=("a b", "c"),
        noise="white",
        strength=50.0,
        start_s=1.0,
        end_s=2.0,
    )
    truth = Truth(values={"x": 0.1 + 0.2}, reached=49.0, channels={"one": 1.0}, beyond={"peer": "a b"})
    store = Store(tmp_path, {})
    store.keep(arm.key, row(arm, truth, findings(A), 1.5))
    assert read(store.rows([arm.key])[0]) == Done(arm, truth, findings(A), 1.5)


def test_every_arm_has_a_key_of_its_own_and_all_kinds_survive_sampling() -> None:
    arms = list(plan([g for g in GROUPS if g != "real"], 2))
    assert len({a.key for a in arms}) == len(arms)
    few = sampled(arms, 0.01)
    assert {(a.body, a.kind) for a in few} == {(a.body, a.kind) for a in arms}
    assert sampled(arms, 1.0) != few
    assert sorted(a.key for a in sampled(arms, 1.0)) == sorted(a.key for a in arms)


@pytest.mark.parametrize("body", BODIES)
def test_nulls_are_drives_of_their_own_and_enough_to_show_the_target(body) -> None:
    """At the chance that the engine is set to, the bound has to come out below that of the target; of 51 nulls none may fail for that, and one did."""
    nulls = [a for a in BODIES[body].arms(3) if a.kind == "null"]
    assert len({a.seed for a in nulls}) == len(nulls)
    once = len([a for a in BODIES[body].arms(1) if a.kind == "null"])
    assert score.upper_bound(round(Settings().alpha * once), once) < 0.05


def test_the_report_lists_failures_and_what_did_not_finish() -> None:
    runs = [
        done(found=(A,), values={"a": 0.5}),
        done(found=(B,), values={"a": 0.5}),
        done("null", (), found=()),
    ]
    text = report.report(
        runs, {"straight null 7": "KilledWorker: x"}, 4, "make proof", {"commit": "abc", "note": ""}
    )
    assert "| truth in the reported group, lambda >= 50 | >= 95 % | 1 of 2 (50 %; 9 to 91) | **no** |" in text
    assert "| straight effect a 250 1 | 250 | a = 0.5 | explained: b |" in text
    assert "- straight null 7: KilledWorker: x" in text
    assert "commit abc" in text


@pytest.mark.parametrize("kind", ["", *KINDS])
@pytest.mark.parametrize("every", [7, 8, 20, 50])
def test_stamps_are_as_dense_as_on_the_grid_and_off_it(kind: str, every: int) -> None:
    found = rows(20_000, every, kind, np.random.default_rng(1))
    pauses = np.diff(found)
    assert found[0] >= 0
    assert found[-1] < 20_000
    assert np.mean(pauses) == pytest.approx(every, rel=0.15)
    assert bool(np.ptp(pauses) > 0) == (kind == "irregular")
    assert bool(np.all(found % every == 0)) == (kind == "")


@pytest.mark.parametrize("stamps", ["", *KINDS])
def test_the_straight_truth_is_the_model_where_nothing_is_hidden(stamps: str) -> None:
    """Without noise the model predicts the truth, by another integrator, within a thousandth; with an effect in an interval it does not, there only."""
    from bench.proof.straight_truth import Noise, record
    from discrepancy.models.straight import MASS_KG, model

    quiet = Noise(speed_sd=1e-9, acceleration_sd=1e-9, quantised=False)
    machine = {"mass": MASS_KG, "viscous": 400.0}
    late = {}
    for name, values, interval in (("none", {}, None), ("hill", {"slope": 0.02}, (40.0, 60.0))):
        rng = np.random.default_rng(1)
        drive = record({**machine, **values}, quiet, rng, interval=interval, stamps=stamps)
        problem = Problem(model(), [drive])
        wrong = np.abs(problem.measured - problem.predict(problem.start()))
        force = problem.row_channel == problem.channels.index("acceleration")
        late[name] = (
            np.max(wrong[force & (problem.row_time < 40.0)]),
            np.max(wrong[force & (problem.row_time > 41.0) & (problem.row_time < 60.0)]),
        )
    assert max(late["none"]) < 0.05
    assert late["hill"][0] < 0.05 < 0.1 < late["hill"][1]


def test_bodies_record_what_their_models_read() -> None:
    for body in BODIES.values():
        for stamps in ("", *KINDS):
            arm = next(a for a in body.arms(1) if a.kind == "null" and a.stamps == stamps)
            recordings = body.record({}, arm, np.random.default_rng(arm.seed))
            model = body.model_of(arm)
            for recording in recordings:
                assert set(model.inputs) <= set(recording.signals)
                assert set(recording.signals) <= {*model.inputs, *model.optional, *model.outputs}


@pytest.mark.parametrize("stamps", ["", *KINDS])
@pytest.mark.parametrize(
    "hidden",
    [
        {},
        {"gyro.delay": 0.004},
        {"gyro.lag": 0.003},
        {"servo_delay": 0.004},
        {"servo_lag": 0.006},
        {"relaxation": 1e-5},
        {"relaxation": 0.01},
        {"slipperiness": 0.5},
        {"encoder.delay": 0.013},
    ],
    ids=str,
)
def test_the_car_truth_is_the_model_with_what_was_hidden_at_its_own_size(monkeypatch, hidden, stamps) -> None:
    """Without noise and with the hidden parameters known: the steering's map is fitted, all that is left is integration."""
    for name in ("GYRO_SD", "ENCODER_SD", "REFERENCE_SD"):
        monkeypatch.setattr(car, name, 1e-12)
    arm = Arm(body="car", kind="effect", seed=1, noise="white", stamps=stamps)
    problem = Problem(car.CAR.model_of(arm), car.recorded(hidden, arm, np.random.default_rng(1)))
    start = problem.start().with_shared(hidden)
    # in units of what is wrong at the start, so that the fit goes on until next to nothing of that is left
    noise = white_noise(problem, problem.measured - problem.predict(start))
    fitted = fit(problem, noise, problem.nuisance_names, start)
    left = np.abs(problem.measured - problem.predict(fitted.values))
    # a line between samples is off by the square of their distance, and at the end the gyro goes on when motion capture has ended
    wider, whole = (2.0, problem.row_time < 59.95) if stamps else (1.0, problem.row_time < np.inf)
    for name, limit in (
        ("gyro", 0.02 * wider),
        ("encoder", 0.02 * wider),
        ("yaw_rate_reference", 0.003 * wider),
    ):
        own = left[whole & (problem.row_channel == problem.channels.index(name))]
        assert np.max(own) < limit
        assert np.sqrt(np.mean(own**2)) < 0.1 * limit


def test_an_effect_is_sized_until_it_has_its_lambda_even_if_that_grows_with_the_fourth_power() -> None:
    """The oracle's lambda is what a fit gains by knowing the effect, but for chance."""
    body = BODIES["car"]
    effect = body.model().effect("grip limit")
    arm = Arm(body="car", kind="effect", seed=30043, effects=("grip limit",), noise="white", strength=250.0)
    sized = body.sized(effect, arm)
    assert sized.reached == pytest.approx(250.0, rel=0.11)
    problem = Problem(body.model(), body.record(sized.values, arm, np.random.default_rng(arm.seed)))
    known = assess(problem, ("grip limit",), problem.start().having(**sized.values), Settings())
    without = fit(problem, known.noise, problem.nuisance_names, known.fit.values.having(slipperiness=0.0))
    assert without.sse - known.fit.sse == pytest.approx(sized.reached, abs=4.0 * np.sqrt(250.0))


def test_play_in_the_steering_is_no_delay_of_the_servo_but_an_equation_with_its_width() -> None:
    """Half the dead zone is 0.01 rad; in commands of 0.4 rad or so each, a fortieth."""
    body = BODIES["car"]
    arm = next(a for a in body.arms(1) if a.what == "steering play 0.01 rad")
    diagnosis = read(body.carried_out(arm)).findings
    assert diagnosis.status == "unknown"
    assert diagnosis.named == []
    assert diagnosis.open_ended is not None
    width = re.match(r".*play\(steering, ([.\d]+)\)·(speed_reference|encoder)", diagnosis.open_ended.equation)
    assert width is not None
    assert float(width[1]) == pytest.approx(0.01 / 0.4, rel=0.15)


@pytest.mark.parametrize("seed", [1, 2, 73011])
def test_friction_that_acts_for_a_while_is_seen_in_its_windows_though_noise_could_hold_it(seed) -> None:
    """4.3 kN from 30 to 68 s, windows of 8 s: noise from which a constant one is projected out holds it to nearly nothing."""
    arm = Arm(body="straight", kind="interval", seed=seed, noise="quantised", start_s=30.0, end_s=68.0)
    body = BODIES["straight"]
    problem = Problem(body.model(), body.record({"rolling": 0.037}, arm, np.random.default_rng(seed)))
    state = assess(problem, (), problem.start(), Settings())
    best, windows = state.temporary[0]
    assert best.effect == "rolling resistance"
    # whole windows from 32 to 64 s; of those before and behind, it acts in a part
    assert {4, 5, 6, 7} <= {*windows} <= {3, 4, 5, 6, 7, 8}


def test_what_is_there_or_not_is_hidden_whole_and_counts_at_any_lambda() -> None:
    arms = [a for a in BODIES["car"].arms(1) if a.effects == ("gyro sign",)]
    assert [a.strength for a in arms] == [np.inf]
    sized = BODIES["car"].sized(BODIES["car"].model().effect("gyro sign"), arms[0])
    assert sized.values == {"gyro.sign": 1.0}
    assert replace(done(), arm=arms[0], truth=sized).reached


def test_arms_off_the_grid_have_lines_of_their_own() -> None:
    """A wrong name there must not hide among the others, nor count twice."""
    runs = [
        done("null", (), found=()),
        done("null", (), found=(B,), stamps="beside"),
        done(found=(A,), values={"a": 0.5}),
        done(found=(B,), values={"a": 0.5}, stamps="irregular"),
    ]
    lines = {line.metric: line.measured for line in score.table(runs)}
    assert lines["false findings on nulls"].startswith("0 of 1 ")
    assert lines["stamps between the grid's points: false findings on nulls"].startswith("1 of 1 ")
    assert lines["truth in the reported group, lambda >= 50"].startswith("1 of 1 ")
    assert lines["stamps at irregular times: truth in the reported group"].startswith("0 of 1 ")
    assert lines["stamps at irregular times: a further, false name beside the truth"].startswith("1 of 1 ")
