"""The report of real lockstep runs: every figure equals the one computed from the run's files by other means.

Truth by numpy from truth.npz, frames by python-can and cantools from bus.log.
"""

import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import can
import cantools
import numpy as np
import pytest

from dbc import FOLDER
from hil import rundir
from hil.check.observed import punctuality_of
from hil.compose import Choice
from hil.rundir import RunDirectory, RunError, read_record
from hil.runs import run_lockstep
from hil.timing.vitals import Life, Vitals
from report.kit.plot import UNITS
from report.run import write_report
from report.run.figures import command
from report.run.section import names
from tests.report.drawn import Outline, points_of

WHEELS = ("front left", "front right", "rear left", "rear right")
LOADS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")


@pytest.fixture(scope="module")
def page(runs, tmp_path_factory):
    return write_report(runs, tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture(scope="module")
def outline(page):
    """The page read back."""
    return Outline.of(page.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def known(runs):
    """What the files of each run hold."""
    database = cantools.database.load_file(FOLDER / "loader.dbc")
    return [read(folder, database) for folder in runs]


def read(folder, database):
    with np.load(folder / "truth.npz") as archive:
        truth = dict(archive)
    frames = {}
    with can.CanutilsLogReader(folder / "bus.log") as log:
        for frame in log:
            message = database.get_message_by_frame_id(frame.arbitration_id)
            values = message.decode(frame.data, decode_choices=False)
            frames.setdefault(message.name, []).append((frame.timestamp, values))
    within = {
        name: SimpleNamespace(
            time=np.array([time for time, _ in rows]),
            **{signal: np.array([values[signal] for _, values in rows]) for signal in rows[0][1]},
        )
        for name, rows in frames.items()
    }
    return SimpleNamespace(folder=folder, truth=truth, frames=within, database=database)


def lift_off(truth):
    """First sample of the first 60 ms in which a wheel carries nothing."""
    off = truth["normal_force"] <= 0
    for i in range(len(off) - 6):
        lifting = np.flatnonzero(off[i : i + 7].all(axis=0))
        if lifting.size:
            return float(truth["time_s"][i]), WHEELS[lifting[0]]
    return None


def first_lasting(time, condition):
    """First of at least six samples, 50 ms, in which the condition holds."""
    run = np.convolve(condition, np.ones(6), "full")[5:] == 6
    return float(time[np.flatnonzero(run)[0]]) if run.any() else np.inf


def first_warning(frames):
    state, flags = frames["RollOver"], frames["Warnings"]
    warned = (state.Valid > 0) & (state.State >= 2) & (state.State <= 4)
    raised = (flags.RollOverPredicted > 0) | (flags.RollOverNow > 0)
    return min(first_lasting(state.time, warned), first_lasting(flags.time, raised))


def column(outline, section, run):
    """A section's table of figures: name -> value of one run."""
    return {row[0]: row[1 + run] for row in outline.tables[section][1:]}


def test_the_page_is_well_formed_and_fetches_nothing(page, outline):
    assert outline.open == []
    assert outline.fetched == []
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"url\((?!data:)|@import|https?://", text)
    assert page.stat().st_size < 5_000_000


def test_what_happened(outline, known):
    free, limited = known
    at, wheel = lift_off(free.truth)
    warned = first_warning(free.frames)
    figures = column(outline, "figures", 0)
    assert figures["First lift-off"] == f"{at:.2f} s, {wheel} wheel"
    assert figures["First warning"] == f"{warned:.2f} s"
    assert figures["Warning ahead of lift-off"] == f"{at - warned:.2f} s before lift-off"
    over = free.truth["time_s"][np.flatnonzero(np.degrees(np.abs(free.truth["roll"])) > 45)[0]]
    assert figures["Rolled over (45°)"] == f"{over:.2f} s"
    assert lift_off(limited.truth) is None
    assert column(outline, "figures", 1)["First lift-off"] == "none"
    for i, run in enumerate(known):
        force = run.truth["normal_force"]
        figures = column(outline, "figures", i)
        assert figures["Smallest wheel load"] == f"{100 * (force / force[0]).min():.0f} % of standing"
        assert figures["Largest roll angle"] == f"{np.degrees(np.abs(run.truth['roll']).max()):.1f}°"
        ratio = (force[:, [1, 3]].sum(axis=1) - force[:, [0, 2]].sum(axis=1)) / force.sum(axis=1)
        assert float(figures["Largest load-transfer ratio"]) == pytest.approx(np.abs(ratio).max(), abs=0.006)


def test_the_story_at_the_top_has_the_same_numbers(outline, known):
    text = " ".join(outline.text)
    at, wheel = lift_off(known[0].truth)
    warned = first_warning(known[0].frames)
    assert f"The {wheel} wheel lifted at {at:.2f} s; the ECU had warned at {warned:.2f} s" in text
    assert "Roll-over prevented" in text
    force = known[1].truth["normal_force"]
    assert f"each kept at least {100 * (force / force[0]).min():.0f} % of its standing load" in text


def test_estimation_errors(outline, known):
    """Estimate minus truth wheel by wheel, where valid, up to lift-off."""
    rows = {row[0]: row[1:] for row in outline.tables["errors"][1:]}
    for i, run in enumerate(known):
        frames, truth = run.frames["NormalForces"], run.truth
        end = lift_off(truth)[0] if lift_off(truth) else truth["time_s"][-1]
        for w, (wheel, name) in enumerate(zip(WHEELS, LOADS, strict=True)):
            usable = (getattr(frames, f"{name}Valid") > 0) & (frames.time <= end)
            true = np.interp(frames.time[usable], truth["time_s"], truth["normal_force"][:, w])
            error = getattr(frames, name)[usable] * 1e3 - true
            rms = np.sqrt(np.mean(error**2))
            shown = [float(cell.replace("−", "-")) for cell in rows[wheel][3 * i : 3 * i + 3]]
            expected = (rms, 100 * rms / truth["normal_force"][0, w], error.mean())
            np.testing.assert_allclose(shown, expected, atol=0.51)


def test_traffic(outline, known):
    """Counts of lines; periods by the stamps; 47 or 67 bits and 8 per byte at 500 kbit/s; no counter skips."""
    tables, start = {}, -1
    for row in outline.tables["traffic"]:
        start += row[0] == "message"
        if len(row) == 6:
            tables.setdefault(start, {})[row[0]] = row[1:]
    for i, run in enumerate(known):
        shown = tables[i]
        total = 0.0
        assert set(shown) - {"message", "all"} == set(run.frames)
        for name, frames in run.frames.items():
            message = run.database.get_message_by_name(name)
            period = np.diff(frames.time).mean()
            bits = (67 if message.is_extended_frame else 47) + 8 * message.length
            total += bits / period / 500_000
            count, cycle, mean, lost, load = shown[name]
            assert int(count) == len(frames.time)
            assert float(cycle) == message.cycle_time
            assert float(mean) == pytest.approx(1e3 * period, abs=0.006)
            assert float(load) == pytest.approx(100 * bits / period / 500_000, abs=0.006)
            assert lost in ("0", "–")
            if lost == "0":
                assert (np.diff(frames.AliveCounter) % 15 == 1).all()
        assert int(shown["all"][0]) == sum(len(f.time) for f in run.frames.values())
        assert float(shown["all"][4]) == pytest.approx(100 * total, abs=0.06)


def test_warnings_raised(outline, known):
    """First and total time of every flag of Warnings that was ever set while there was a machine."""
    shown = [row for row in outline.tables["states"] if len(row) == 4]
    tables = [[]]
    for row in shown[1:]:
        if row[0] == "warning":
            tables.append([])
        else:
            tables[-1].append(row)
    for table, run in zip(tables, known, strict=True):
        flags = run.frames["Warnings"]
        last = flags.time <= run.truth["time_s"][-1]
        raised = {}
        for name, values in vars(flags).items():
            if (
                name in ("time", "Crc", "AliveCounter", "Level")
                or name.startswith("Front")
                or not values[last].any()
            ):
                continue
            time, value = flags.time[last], values[last]
            first = time[np.flatnonzero(value)[0]]
            raised[name.lower()] = (first, np.diff(time)[value[:-1] > 0].sum())
        found = {row[0].replace(" ", "").lower(): (float(row[2]), float(row[3])) for row in table}
        assert set(found) == set(raised)
        for name, (first, length) in raised.items():
            assert found[name] == pytest.approx((first, length), abs=0.006)


@pytest.mark.parametrize(
    ("title", "curve", "values"),
    [
        ("Normal force, rear right", "true", lambda r: r.truth["normal_force"][:, 3] * 1e-3),
        ("Speed", "true", lambda r: r.truth["speed"] * 3.6),
        ("Articulation angle, positive: left", "true", lambda r: np.degrees(r.truth["articulation_angle"])),
        ("Normal force, rear right", "estimated", lambda r: r.frames["NormalForces"].RearRight),
        (
            "Articulation angle, positive: left",
            "sensor",
            lambda r: r.frames["Articulation"].ArticulationAngle,
        ),
    ],
)
def test_curves_read_back_to_the_samples(outline, known, title, curve, values):
    """From the drawn path: every sample within a ten-thousandth of either axis."""
    messages = {"estimated": "NormalForces", "sensor": "Articulation"}
    for plot, run in zip(outline.plots[title], known, strict=True):
        index = plot["legend"].index(curve)
        pieces = points_of(
            f' d="{plot["paths"][index][1]}"'
        )  # an estimate that is not valid interrupts its curve
        (start, end), (low, high) = plot["t"], plot["y"]
        x, y = np.unique(
            np.concatenate(pieces), axis=0
        ).T  # a sample alone is drawn as a dot: the point twice
        time = start + x / UNITS * (end - start)
        value = high - y / UNITS * (high - low)
        clock = run.frames[messages[curve]].time if curve in messages else run.truth["time_s"]
        inside = clock <= run.truth["time_s"][-1]
        if curve == "estimated":
            inside &= run.frames["NormalForces"].RearRightValid > 0
        np.testing.assert_allclose(time, clock[inside], atol=(end - start) / UNITS)
        np.testing.assert_allclose(value, values(run)[inside], atol=(high - low) / UNITS)


def test_the_interval_is_1_96_standard_deviations_wide_to_either_side(outline, known):
    """By the standard deviations on the bus, each held until the next."""
    for plot, run in zip(outline.plots["Normal force, rear right"], known, strict=True):
        loads, sure = run.frames["NormalForces"], run.frames["EstimateUncertainty"]
        assert plot["legend"][1] == plot["legend"][2] == "95 % interval"
        newest = np.searchsorted(sure.time, loads.time, side="right") - 1
        sent = sure.NormalForceRearRight[np.maximum(newest, 0)]
        shown = (newest >= 0) & (sent < 12.72) & (loads.RearRightValid > 0)
        shown &= loads.time <= run.truth["time_s"][-1]
        (start, end), (low, high) = plot["t"], plot["y"]
        for index, sign in ((1, 1.0), (2, -1.0)):
            x, y = np.unique(np.concatenate(points_of(f' d="{plot["paths"][index][1]}"')), axis=0).T
            wanted = (loads.RearRight + sign * 1.96 * sent)[shown]
            np.testing.assert_allclose(
                start + x / UNITS * (end - start), loads.time[shown], atol=(end - start) / UNITS
            )
            np.testing.assert_allclose(high - y / UNITS * (high - low), wanted, atol=(high - low) / UNITS)


def test_the_same_plot_of_both_runs_has_one_range(outline):
    assert len(outline.plots) > 12
    for plots in outline.plots.values():
        assert len({(plot["t"], plot["y"]) for plot in plots}) == 1


def life(process, waited):
    """Of a process that waited for a processor for a share of the time."""
    return Life(
        process=process, pid=1, seconds=20.0, start_bytes=2**27, settled_bytes=None, end_bytes=2**27 + 2**20,
        largest_bytes=2**27, waited=waited, worst_waited=waited,
    )  # fmt: skip


def realtime(source, folder, *, waited=0.0, late_ns=2e5):
    """The run as if it had been made in real time, with timing of known percentiles."""
    shutil.copytree(source, folder)
    with np.load(source / "truth.npz") as archive:
        time_s = archive["time_s"]
    random = np.random.default_rng(3)
    columns = {"plant_due_ns": np.rint(time_s * 1e9).astype(np.int64)}
    for who in ("plant", "ecu"):
        columns[f"{who}_lateness_ns"] = random.exponential(late_ns, time_s.size).astype(np.int64)
        columns[f"{who}_execution_ns"] = random.normal(6e5, 5e4, time_s.size).astype(np.int64)
    np.savez(folder / "timing.npz", **columns)
    lives = tuple(
        life(who, waited if who == "plant" else 0.01) for who in ("plant", "ecu", "gateway", "plant-hub")
    )
    vitals = Vitals(stolen=0.0, worst_stolen=0.0, lives=lives)
    rundir.write_record(folder, replace(read_record(source), mode="realtime", vitals=vitals))
    return columns


def test_loop_timing(runs, tmp_path):
    columns = realtime(runs[1], tmp_path / "run")
    outline = Outline.of(write_report([tmp_path / "run"], tmp_path / "page.html").read_text(encoding="utf-8"))
    figures = column(outline, "timing", 0)
    for name, label in (("plant", "plant"), ("ecu", "ECU")):
        for what, column_name in (("Lateness", "lateness"), ("Execution", "execution")):
            values = columns[f"{name}_{column_name}_ns"] * 1e-6
            expected = (np.median(values), np.percentile(values, 99), values.max())
            assert figures[f"{what} of the {label}'s tick"] == "{:.2f} / {:.2f} / {:.2f} ms".format(*expected)
    assert figures["Frames lost"] == "0"
    text = " ".join(outline.text)
    assert "PASSED" in text
    for who in ("plant", "ecu"):
        assert f"median {np.median(columns[f'{who}_lateness_ns']) * 1e-6:.2f}" in text


def test_deadlines_of_messages_and_tasks(runs, tmp_path):
    """What the record says of each, in the order of the record; a gateway's waiting is listed too."""
    folder = tmp_path / "run"
    columns = realtime(runs[1], folder)
    record = read_record(folder)
    kept = punctuality_of(RunDirectory.read(folder))
    rundir.write_record(folder, replace(record, punctuality=kept))
    outline = Outline.of(write_report([folder], tmp_path / "page.html").read_text(encoding="utf-8"))
    tasks, messages = ([row for row in outline.tables["deadlines"] if len(row) == width] for width in (6, 11))
    assert [row[0] for row in tasks[1:]] == ["plant", "ECU"]
    lateness = columns["plant_lateness_ns"] * 1e-6
    assert f"{np.median(lateness):.2f} / {np.percentile(lateness, 99):.2f}" in tasks[1][2]
    shown = {row[0]: (row[2], row[-1]) for row in messages[1:]}
    assert shown == {
        one.verdict.name: (str(one.verdict.frames), one.verdict.result.value) for one in kept.messages
    }
    assert "PASSED" in {result for _, result in shown.values()}
    assert "every message in time" in " ".join(outline.text)
    figures = column(outline, "timing", 0)
    assert figures["Time the gateway waited for a processor"] == "1.0 %"
    assert figures["Memory of the plant-hub, start / end"] == "128.0 / 129.0 MiB"


def test_a_late_run_on_a_starved_host_is_inconclusive_with_the_reason(runs, tmp_path):
    realtime(runs[1], tmp_path / "run", waited=0.2, late_ns=2e7)
    outline = Outline.of(write_report([tmp_path / "run"], tmp_path / "page.html").read_text(encoding="utf-8"))
    text = " ".join(outline.text)
    assert "INCONCLUSIVE" in text
    assert "plant waited 20.0 % of the time for a processor" in text


def test_what_was_run_can_be_run_again(outline, runs):
    for i, folder in enumerate(runs):
        record = json.loads((folder / "run.json").read_text())
        figures = column(outline, "conditions", i)
        assert figures["Scenario"] == record["scenario"]
        assert figures["Seed of the sensor noise"] == str(record["seed"])
        assert ("--no-limits" in figures["Run it again"]) == (not record["limits"])
        assert f"--seed {record['seed']}" in figures["Run it again"]


def test_a_run_in_c_is_run_again_in_c(runs):
    run = RunDirectory.read(runs[0])
    assert "--ecu-core" not in command(run)
    for detect_faults in (False, True):
        again = command(replace(run, record=replace(run.record, detect_faults=detect_faults)))
        assert ("--no-detect-faults" in again) == (not detect_faults)
    assert "--ecu-core c" in command(replace(run, record=replace(run.record, ecu_core="c")))


def test_runs_are_named_by_what_distinguishes_them(runs):
    free, limited = (read_record(folder) for folder in runs)
    assert names([free, replace(free, ecu_core="c")]) == ["python core", "c core"]
    assert names([free, limited]) == ["limits off", "limits on"]
    assert names([free, free]) == ["run (1)", "run (2)"]
    assert names([limited]) == ["limits on"]


def test_a_run_that_lost_its_files_still_gives_a_page_that_says_so(runs, tmp_path):
    half = tmp_path / "half"
    shutil.copytree(runs[0], half)
    (half / "truth.npz").unlink()
    log = (half / "bus.log").read_bytes()
    (half / "bus.log").write_bytes(log[: len(log) // 2 + 7])
    record = json.loads((half / "run.json").read_text())
    (half / "run.json").write_text(json.dumps({**record, "outcome": "running"}))
    outline = Outline.of(write_report([half], tmp_path / "half.html").read_text(encoding="utf-8"))
    text = " ".join(outline.text)
    assert outline.open == []
    assert "What is missing" in text
    assert "truth.npz" in text
    assert "killed" in text
    assert "Not judged" in text


def test_no_run_is_one_clear_error(tmp_path):
    with pytest.raises(RunError, match="at least one"):
        write_report([], tmp_path / "none.html")
    with pytest.raises(RunError, match="no such run"):
        write_report([tmp_path / "nothing"], tmp_path / "none.html")


def test_a_quiet_run_has_pictures_and_no_alarm(tmp_path):
    run_lockstep(Choice(scenario="standstill"), tmp_path / "still")
    page = write_report([tmp_path / "still"], tmp_path / "still.html")
    outline = Outline.of(page.read_text(encoding="utf-8"))
    text = " ".join(outline.text)
    assert page.read_text(encoding="utf-8").count("data:image/png") == 3  # two moments and the views
    assert "All wheels stayed down" in text
    assert "No warning came" in text
