"""Concealed recordings and their scores: the truth is in the recording, in the seal, and nowhere else."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.blind.hidden import Fault, NotHidden, Truth, chosen, concealed, drawn, faint, staged
from diagnosis.blind.score import compared
from diagnosis.blind.seal import BrokenSeal, seal, unseal
from diagnosis.reading.channels import to_recording
from diagnosis.reading.csv_writer import csv_text
from diagnosis.reading.tables import read_table
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Manoeuvre, Model
from discrepancy.models import ball, car, road, straight
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Candidate, Estimate, Findings, Verdict
from hil.ending import Ending
from tests.diagnosis.cases import columns, finding, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, tank

__all__ = ["loaderhil"]


def quiet(**changes: object) -> Truth:
    return replace(Truth(model="tank", seed=3, noise={"level": 0.0}), **changes)  # type: ignore[arg-type]


def test_without_noise_the_recording_is_the_model_with_the_effect_on() -> None:
    model, basis = tank(), record(1)
    hidden = concealed(
        model, basis, quiet(effects={"leak": {"leak": 0.1}}, nuisances={"area": 1.03}), {"level": 0.5}
    )
    problem = Problem(replace(model, window_s=None), [hidden])
    right = problem.start().with_shared({"leak": 0.1, "area": 1.03})
    wrong = problem.start()
    right.local["level"][:] = wrong.local["level"][:] = 0.5
    assert np.max(np.abs(problem.predict(right) - problem.measured)) < 1e-9  # the tank's step is exact
    assert np.max(np.abs(problem.predict(wrong) - problem.measured)) > 0.1


def test_noise_has_the_size_and_memory_asked_for() -> None:
    model, basis = tank(), record(1, duration_s=600.0)
    clean = concealed(model, basis, quiet(), {"level": 0.5}).signals["level"].value
    noisy = (
        concealed(model, basis, quiet(noise={"level": 0.2}, memory=0.7), {"level": 0.5})
        .signals["level"]
        .value
    )
    noise = noisy - clean
    assert np.std(noise) == pytest.approx(0.2, rel=0.05)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0.7, abs=0.04)


def test_a_model_that_knows_its_sensors_gets_their_noise() -> None:
    model, basis = replace(tank(), sensor_noise={"level": 0.07}), record(1)
    clean = concealed(model, basis, quiet(), {"level": 0.5}).signals["level"].value
    noisy = concealed(model, basis, replace(quiet(), noise={}), {"level": 0.5}).signals["level"].value
    assert np.std(noisy - clean) == pytest.approx(0.07, rel=0.1)


def test_a_seed_gives_the_same_recording_and_another_one_another() -> None:
    model, basis, loud = tank(), record(1), quiet(noise={"level": 0.2})
    texts = [csv_text(concealed(model, basis, replace(loud, seed=seed))) for seed in (3, 3, 4)]
    assert texts[0] == texts[1] != texts[2]
    assert drawn(model, 2, np.random.default_rng(5)) == drawn(model, 2, np.random.default_rng(5))


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        (Fault(channel="level", kind="lost", share=0.3), lambda s, _: s.value.size == pytest.approx(840, abs=60)),
        (Fault(channel="level", kind="damaged", share=0.3), lambda s, _: np.isnan(s.value).sum() == pytest.approx(360, abs=60)),
        (Fault(channel="level", kind="gap", start_s=10.0, end_s=20.0), lambda s, _: not np.any((s.time_s >= 10) & (s.time_s <= 20))),
        (Fault(channel="level", kind="stuck", start_s=10.0, end_s=20.0), lambda s, _: np.ptp(s.value[(s.time_s >= 10) & (s.time_s <= 20)]) == 0.0),
        (Fault(channel="level", kind="spikes", share=0.05), lambda s, clean: np.count_nonzero(np.abs(s.value - clean.value) > 5 * np.std(clean.value)) == pytest.approx(60, abs=25)),
    ],
    ids=lambda f: getattr(f, "kind", ""),
)  # fmt: skip
def test_faults_do_what_they_say(fault: Fault, check) -> None:  # type: ignore[no-untyped-def]
    clean = concealed(tank(), record(1), quiet()).signals["level"]
    faulty = concealed(tank(), record(1), quiet(faults=[fault])).signals["level"]
    assert check(faulty, clean)


def test_a_written_recording_reads_back_to_the_last_bit(tmp_path: Path) -> None:
    """Two rates, held inputs, constants and all."""
    basis = record(1)
    level = basis.signals["level"]
    slow = replace(
        basis,
        signals={
            **basis.signals,
            "level": replace(level, time_s=level.time_s[::3] + 0.01, value=level.value[::3]),
        },
        constants={"mass": 0.1 + 0.2},
    )
    (tmp_path / "r.csv").write_text(csv_text(slow))
    back, complaints = to_recording(read_table(tmp_path / "r.csv"), "r.csv", tank(), {})
    assert complaints == []
    assert back.constants == slow.constants
    for name, signal in slow.signals.items():
        np.testing.assert_array_equal(back.signals[name].time_s, signal.time_s)
        np.testing.assert_array_equal(back.signals[name].value, signal.value)


@pytest.mark.parametrize("model", [ball.model(), car.model(), straight.model()], ids=lambda m: m.name)
def test_every_model_with_manoeuvres_can_be_concealed(model) -> None:  # type: ignore[no-untyped-def]
    constants = {"mass": 0.06, "diameter": 0.065} if model.name == "ball" else {}
    manoeuvre = model.manoeuvres[0]
    basis = staged(model, manoeuvre, constants)
    for effect in model.effects:
        truth = Truth(model=model.name, seed=1, effects={effect.name: chosen(model, effect.name, [])})
        made = concealed(model, basis, truth, manoeuvre.initial)
        assert all(np.isfinite(s.value).all() for s in made.signals.values())


def test_what_cannot_be_hidden_is_refused() -> None:
    for bad in (lambda: chosen(tank(), "ghost", []), lambda: chosen(tank(), "leak", [5.0]), lambda: chosen(tank(), "leak", [0.1, 0.2]),
                lambda: concealed(tank(), record(1), quiet(nuisances={"ghost": 1.0})), lambda: concealed(tank(), record(1), quiet(nuisances={"area": 9.0})),
                lambda: concealed(tank(), record(1), quiet(noise={"level": -0.1})), lambda: concealed(tank(), record(1), quiet(noise={"depth": 0.1})),
                lambda: concealed(tank(), record(1), quiet(faults=[Fault(channel="level", kind="gap", start_s=500.0, end_s=510.0)])),
                lambda: drawn(tank(), 99, np.random.default_rng(0))):  # fmt: skip
        with pytest.raises(NotHidden):
            bad()


@pytest.mark.parametrize(("size", "lines"), [(0.6, 1), (30.0, 0)])
def test_an_effect_too_small_to_be_seen_is_reported(size: float, lines: int) -> None:
    reported = faint(straight.model(), {"quadratic drag": {"square": size}})
    assert len(reported) == lines
    assert all("square=0.6 is 2% of its typical 30 kg/m" in line for line in reported)


def test_a_seal_hides_opens_and_breaks(tmp_path: Path) -> None:
    file = tmp_path / "recording.csv"
    file.write_text("x")
    truth = quiet(effects={"leak": {"leak": 0.1}}, faults=(Fault(channel="level", kind="lost", share=0.1),))
    text = seal(truth, [file])
    assert "leak" not in text
    sealed = tmp_path / "truth.sealed"
    sealed.write_text(text)
    assert unseal(sealed).truth == replace(truth, faults=list(truth.faults))
    for damaged in (text[:-20], text.replace("sealed", "open", 1), text[:100] + "?" + text[101:], ""):
        sealed.write_text(damaged)
        with pytest.raises(BrokenSeal):
            unseal(sealed)


def diagnosed(
    *effects: str, named: bool = True, group: tuple[str, ...] = (), interval: tuple[float, float] = (0.0, 1.0)
) -> Findings:
    findings = [finding(e, "physics", {e: 0.5}, named=named, group=group, interval=interval) for e in effects]
    return Findings(model="tank", recordings=["r"], status="explained", reasons=[], findings=findings)


def unseen(
    effect: str, verdict: Verdict = "could not be judged", smallest_detectable: float | None = None
) -> Candidate:
    limit = Estimate(
        name=effect, value=smallest_detectable or 0.0, low=None, high=None, unit="1/s", baseline=0.0
    )
    return Candidate(
        effect=effect, kind="physics", verdict=verdict, statistic=0.0, p_value=1.0, expected=[],
        power=0.0, confounded_share=0.0, smallest_detectable=[limit] if smallest_detectable else [], reason="",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("result", "hidden", "place", "false", "ending"),
    [
        (diagnosed("leak"), ["leak"], "named", [], Ending.PASSED),
        (diagnosed("offset", group=("leak",)), ["leak"], "in group", [], Ending.PASSED),
        (diagnosed("leak", named=False), ["leak"], "proxy", [], Ending.FAILED),
        (diagnosed(), ["leak"], "missed", [], Ending.FAILED),
        (diagnosed("leak", "offset"), ["leak"], "named", ["offset"], Ending.FAILED),
        (diagnosed("offset"), ["leak"], "missed", ["offset"], Ending.FAILED),
        (diagnosed(), [], "", [], Ending.PASSED),
        (diagnosed("offset"), [], "", ["offset"], Ending.FAILED),
        (replace(diagnosed(), candidates=[unseen("leak")]), ["leak"], "not visible", [], Ending.INCONCLUSIVE),
        (replace(diagnosed(), candidates=[unseen("offset")]), ["leak"], "missed", [], Ending.FAILED),
        (
            replace(diagnosed(), candidates=[unseen("leak", "ruled out", 0.6)]),
            ["leak"],
            "not visible",
            [],
            Ending.INCONCLUSIVE,
        ),
        (
            replace(diagnosed(), candidates=[unseen("leak", "ruled out", 0.4)]),
            ["leak"],
            "missed",
            [],
            Ending.FAILED,
        ),
        (
            replace(diagnosed(), candidates=[unseen("leak", smallest_detectable=0.4)]),
            ["leak"],
            "missed",
            [],
            Ending.FAILED,
        ),
        (
            replace(diagnosed(), candidates=[unseen("leak", "ruled out")]),
            ["leak"],
            "missed",
            [],
            Ending.FAILED,
        ),
        (
            replace(diagnosed("offset"), candidates=[unseen("leak")]),
            ["leak"],
            "not visible",
            ["offset"],
            Ending.FAILED,
        ),
    ],
)
def test_scores(result: Findings, hidden: list[str], place: str, false: list[str], ending: Ending) -> None:
    score = compared(result, quiet(effects={e: {e: 0.5} for e in hidden}))
    assert [row.place for row in score.rows] == ([place] if hidden else [])
    assert list(score.false_names) == false
    assert score.ending is ending


OWN = [(model, manoeuvre) for model in (straight.model(), car.model()) for manoeuvre in model.manoeuvres]


@pytest.mark.parametrize(("model", "manoeuvre"), OWN, ids=[f"{m.name}: {own.name}" for m, own in OWN])
@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_is_hidden_in_a_models_own_manoeuvre_nothing_is_found(
    model: Model, manoeuvre: Manoeuvre, seed: int, tmp_path: Path
) -> None:
    """The truth is simulated at a fifth of the model's step: only that step and the noise may differ."""
    truth = Truth(model=model.name, seed=seed)
    (tmp_path / "r.csv").write_text(
        csv_text(concealed(model, staged(model, manoeuvre, {}), truth, manoeuvre.initial))
    )
    recording, _ = to_recording(read_table(tmp_path / "r.csv"), "r.csv", model, {})
    result = examine(model, [recording], Settings())
    assert result.status == "nothing missing", result.reasons


@pytest.mark.parametrize("effect", ["encoder delay", "encoder scale", "understeer"])
def test_changing_throttle_shows_what_one_speed_cannot(effect: str) -> None:
    model = car.model()
    steady, surging = [
        examine(model, [concealed(model, staged(model, manoeuvre, {}), truth, manoeuvre.initial)], Settings())
        for truth in [Truth(model="car", seed=1, effects={effect: chosen(model, effect, [])})]
        for manoeuvre in model.manoeuvres
    ]
    assert next(c for c in steady.candidates if c.effect == effect).verdict == "could not be judged"
    assert surging.named == [effect]


def test_an_interval_holds_the_truth_or_not() -> None:
    for interval, holds in (((0.4, 0.6), True), ((0.6, 0.7), False)):
        [row] = compared(diagnosed("leak", interval=interval), quiet(effects={"leak": {"leak": 0.5}})).rows
        assert row.within is holds


def test_conceal_diagnose_score(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole way on the command line; a recording changed after it was sealed is refused."""
    from loaderhil import cli

    def call(*words: object) -> int:
        monkeypatch.setattr("sys.argv", ["loaderhil", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0)

    model, folder = model_file(tmp_path), tmp_path / "blind"
    like = write_csv(tmp_path / "like.csv", columns(record(1)))
    noise = ("--noise", "level=0.02", "--fault", "level:damaged=0.02", "--parameter", "area=1.02")
    assert (
        call(
            "conceal", folder, "--model", model, "--effect", "leak=0.09", "--like", like, "--seed", 5, *noise
        )
        == 0
    )
    assert "leak" not in (folder / "truth.sealed").read_text()
    assert call("diagnose", folder / "recording.csv", "--model", model, "--out", folder) == 0
    capsys.readouterr()
    assert call("score", folder) == 0
    said = capsys.readouterr().out
    assert "named" in said
    assert "0.09" in said
    text = (folder / "recording.csv").read_text()
    (folder / "recording.csv").write_text(text.replace("0.", "1.", 1))
    assert call("score", folder) == 2
    assert "was changed after it was sealed" in capsys.readouterr().err
    for words in (
        ("--effect", "ghost"),
        ("--effect", "leak=0.1", "--effect", "leak=0.2"),
        ("--fault", "level:melts=1"),
        ("--fault", "depth:lost=1"),
        ("--noise", "level"),
        (),
    ):
        source = ("--like", like) if words else ()
        assert call("conceal", folder, "--model", model, *source, *words) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_road_without_its_distance_still_climbs() -> None:
    """The distance is then that of the wheels."""
    from discrepancy.signals.recording import Recording, signal

    t = np.arange(0.0, 60.0, 0.05)
    basis = Recording(
        "r",
        {"wheel_speed": signal(t, 10.0 + np.sin(0.3 * t), "m/s"), "accel_x": signal(t, t.copy(), "m/s^2")},
    )
    model = road.model([basis])
    grade = model.effect("road grade")
    assert len(grade.parameters) == pytest.approx(600.0 / road.KNOT_M, abs=2)
    sizes = [0.05] * len(grade.parameters)
    made = concealed(
        model,
        basis,
        Truth(
            model="road",
            seed=0,
            effects={"road grade": chosen(model, "road grade", sizes)},
            noise={"accel_x": 0.0},
        ),
    )
    flat = concealed(model, basis, Truth(model="road", seed=0, noise={"accel_x": 0.0}))
    lifted = made.signals["accel_x"].value - flat.signals["accel_x"].value
    np.testing.assert_allclose(lifted, 9.81 * np.sin(0.05), rtol=1e-6)


def test_a_run_of_the_bench_does_not_name_its_concealed_effect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run is that of a machine with the effects, to the frame; seal, score and refusals as for any model."""
    from discrepancy.signals.findings import to_json
    from hil.compose import Choice
    from hil.rundir import read_record
    from hil.runs import run_lockstep
    from loaderhil import cli

    def call(*words: object) -> int:
        monkeypatch.setattr("sys.argv", ["loaderhil", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0)

    scenario = tmp_path / "short.toml"
    scenario.write_text(
        'name = "short"\nsentence = "Rolls."\nduration_s = 0.5\nmachine = "l60"\n[start]\nspeed_kmh = 8.0\n'
    )
    hidden = ("--effect", "payload_mass=700", "--effect", "yaw_rate bias=0.1", "--seed", 7)
    folder = tmp_path / "blind"
    assert call("conceal", folder, "--model", "loader", "--manoeuvre", scenario, *hidden) == 0
    assert not (folder / "run" / "truth.npz").exists()
    record_of = read_record(folder / "run")
    assert (record_of.changes, record_of.seed) == ((), 7)
    words = (
        "machine.effects.payload_mass.extra_kg=700",
        f"equipment.sensors.yaw_rate.bias_deg_s={0.3 + float(np.degrees(0.1))!r}",
    )
    run_lockstep(Choice(scenario=str(scenario), seed=7, changes=words), tmp_path / "open")
    assert (folder / "run" / "bus.log").read_text() == (tmp_path / "open" / "bus.log").read_text()
    found = finding("payload_mass", "physics", {"payload_mass.extra_kg": 650.0})
    result = Findings(model="loader", recordings=["run"], status="explained", reasons=[], findings=[found])
    (folder / "findings.json").write_text(to_json(result))
    capsys.readouterr()
    assert call("score", folder) == 1
    assert "yaw_rate bias" in capsys.readouterr().out
    (folder / "run" / "bus.log").write_text("")
    assert call("score", folder) == 2
    assert "was changed after it was sealed" in capsys.readouterr().err
    assert call("conceal", folder, "--model", "loader", "--noise", "yaw_rate=1") == 2
    assert "--noise: not available for the loader, whose runs come from the bench" in capsys.readouterr().err


def test_a_run_that_was_interrupted_is_no_hidden_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run cut short would be sealed as whole, and its truth would lie open."""
    from diagnosis.blind.hidden_run import concealed_run
    from hil.compose import Choice
    from hil.lockstep import Lockstep

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Lockstep, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        concealed_run(
            Choice(scenario="standstill"), Truth(model="loader", seed=1), tmp_path / "blind" / "run"
        )
    assert not (tmp_path / "blind" / "run").exists()
