"""`loaderhil render`: which moments are drawn, what is written on them, files that read back."""

from dataclasses import replace

import av
import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from hil.compose import Choice
from hil.judgement import judge_run
from hil.rundir import RunDirectory, Table
from hil.runs import run_lockstep
from hil.verdict import roll_over_warning
from report.render import command, film
from report.render.board import COLOURS, WarningLine, written
from report.render.camera import View, scene_in
from report.render.film import RenderError, Shot, checked, decisive_moment, frames, write
from report.render.loader import Dimensions
from report.render.pictures import AFTER_LIFT_OFF_S, dimensions_of, instant_at
from report.render.scene import view_of

SIZE = (320, 180)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The machine rolls over, on a wider track than its file says."""
    folder = tmp_path_factory.mktemp("run")
    words = ("machine.geometry.track_m=1.9", "duration_s=7")
    run_lockstep(Choice(scenario="abrupt_articulation", limits=False, changes=words), folder)
    return folder


@pytest.fixture(scope="module")
def run(folder):
    return checked(RunDirectory.read(folder))


def shot(start=2.0, end=3.0, fps=5.0, view=View.FRONT_LEFT):
    return Shot(start_s=start, end_s=end, fps=fps, view=view, size=SIZE)


def render(*words):
    app = typer.Typer()
    command.register(app)
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_drawing_follows_what_was_set_for_the_run(run):
    assert dimensions_of(run.record.machine, run.record.changes).track == 1.9
    assert dimensions_of(run.record.machine).track != 1.9


def test_pictures_are_taken_from_the_first_moment_to_the_last():
    assert shot(2.0, 3.0, 4.0).times_s == pytest.approx([2.0, 2.25, 2.5, 2.75, 3.0])
    assert shot(2.0, 2.0).times_s == [2.0]


def test_the_decisive_moment_is_just_after_lift_off(run):
    assert decisive_moment(run) == pytest.approx(judge_run(run).lift_off_s + AFTER_LIFT_OFF_S)


def test_the_warning_is_the_frame_that_stood_on_the_bus(run):
    line, columns = WarningLine.of(run), run.messages["RollOver"]
    time, warns = columns.time_s, roll_over_warning(columns.signals["State"], columns.signals["Valid"])
    first = int(np.flatnonzero(warns)[0])
    assert line.at(time[first] - 1e-4) in ("stable", "attention")
    assert line.at(time[first] + 1e-4) in ("warning", "imminent", "wheel lifted")
    assert line.at(time[0] - 1.0) == "no estimate"
    assert WarningLine.of(replace(run, messages={})).at(1.0) == "not recorded"


@pytest.mark.parametrize(("word", "bordered"), [("stable", False), ("warning", True), ("wheel lifted", True)])
def test_a_warned_frame_has_a_border_and_every_frame_its_word(run, word, bordered):
    grey = np.full((180, 320, 3), 128, np.uint8)
    seen = written(grey, 1.0, instant_at(run, 1.0), 3.0, word)
    assert (tuple(seen[0, 160]) == COLOURS[word]) is bordered
    assert (seen == COLOURS[word]).all(axis=2)[:30, 200:].sum() > 300  # the badge, top right
    assert (grey == 128).all()


def test_bars_are_as_long_as_the_loads(run):
    grey = np.full((540, 960, 3), 128, np.uint8)

    def blue(load):
        instant = {**instant_at(run, 1.0), "normal_force": np.array((load, 0.0, 0.0, 0.0))}
        return int((written(grey, 1.0, instant, 3.0, "stable") == (0, 115, 204)).all(axis=2).sum())

    assert blue(40e3) == pytest.approx(2 * blue(20e3), rel=0.06)
    assert blue(0.0) == 0


@pytest.mark.parametrize(("view", "turns"), [(View.BEHIND, True), (View.LEFT, True), (View.ABOVE, False)])
def test_only_some_cameras_turn_with_the_machine(run, view, turns):
    now = instant_at(run, 1.0)
    turned = {**now, "yaw": float(now["yaw"]) + 0.5}
    before, after = (view_of(scene_in(view, i, Dimensions(), 0.0, SIZE))[1] for i in (now, turned))
    assert (not np.allclose(before, after)) is turns


def test_a_video_reads_back(run, tmp_path):
    file = tmp_path / "a" / "drive.mp4"
    write(file, frames(run, shot()), 5.0)
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        read = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert float(stream.average_rate) == 5.0
    drawn = list(frames(run, shot()))
    assert len(read) == len(drawn) == 6
    for ours, theirs in zip(drawn, read, strict=True):
        assert np.abs(ours.astype(int) - theirs.astype(int)).mean() < 6.0  # colour at half resolution


def test_a_gif_reads_back(run, tmp_path):
    file = tmp_path / "drive.gif"
    write(file, frames(run, shot()), 5.0)
    with Image.open(file) as image:
        assert (image.n_frames, image.size, image.info["duration"]) == (6, SIZE, 200)


def test_nothing_is_left_of_a_file_that_could_not_be_finished(run, tmp_path):
    def breaking():
        yield from frames(run, shot(end=2.2))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "drive.mp4", breaking(), 5.0)
    assert list(tmp_path.iterdir()) == []


def test_the_command_draws_the_decisive_moment(folder, tmp_path):
    done = render(folder, "--out", tmp_path / "a.png", "--width", 320, "--view", "above")
    assert done.exit_code == 0, done.output
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == SIZE


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--out", "a.avi"), "is none of .png, .gif, .mp4"),
        (("--out", "a.gif", "--from", "3", "--to", "2"), "--from 3 s --to 2 s is not within the run"),
        (("--out", "a.png", "--from", "99"), "--from 99 s"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(folder, words, message):
    problem = render(folder, *words).exception
    assert message in str(problem)
    assert "\n" not in str(problem)


def test_a_run_without_truth_is_reported(run):
    with pytest.raises(RenderError, match="its truth has no"):
        checked(replace(run, truth=Table(run.path, {})))
    broken = {name: run.truth[name].copy() for name in run.truth}
    broken["roll"] = broken["roll"] * 1.0
    broken["speed"][3] = np.nan
    with pytest.raises(RenderError, match="speed of its truth is not finite"):
        checked(replace(run, truth=Table(run.path, broken)))


def test_without_pyav_the_remedy_is_reported(monkeypatch, tmp_path):
    import sys

    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RenderError, match=r"pip install 'loaderhil\[render\]'"):
        film.suffix_checked(tmp_path / "a.mp4")
    film.suffix_checked(tmp_path / "a.gif")
