"""Which pictures a run gets: the moments that matter, the film over the whole run, and why there are none."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from hil.compose import Choice
from hil.judgement import judge_run
from hil.rundir import RunDirectory, Table
from hil.runs import run_lockstep
from hil.verdict import RunVerdict
from report.render.pictures import (
    AFTER_LIFT_OFF_S,
    FILM_COLUMNS,
    FILM_FRAMES,
    FILM_SIZE,
    VIEW_SIZE,
    instant_at,
    moments,
    pictures_of,
    render,
)

QUIET = RunVerdict(
    lift_off_s=None,
    lifting_wheel=None,
    rolled_over_s=None,
    warned_s=None,
    margin=0.8,
    largest_roll=0.01,
    largest_load_transfer=0.1,
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The machine rolls over to its right: a left wheel lifts."""
    folder = tmp_path_factory.mktemp("run")
    run_lockstep(Choice(scenario="abrupt_articulation", limits=False), folder)
    return RunDirectory.read(folder)


@pytest.fixture(scope="module")
def pictures(run):
    return pictures_of(run, judge_run(run))


def opened(data):
    return Image.open(io.BytesIO(data))


def test_a_lift_off_is_shown_when_the_gap_can_be_seen():
    lifted = replace(QUIET, lift_off_s=4.0, lifting_wheel=2)
    ((at, what),) = moments(lifted, 10.0, 4.0)
    assert at == 4.0 + AFTER_LIFT_OFF_S
    assert "rear left wheel lifted" in what
    assert moments(lifted, 4.1, 4.0)[0][0] == 4.1  # the run ends first
    assert moments(replace(lifted, rolled_over_s=5.5), 10.0, 4.0)[-1][0] == 5.5


def test_a_quiet_run_is_shown_where_a_wheel_carries_least_and_at_its_end():
    assert [at for at, _ in moments(QUIET, 10.0, 3.2)] == [3.2, 10.0]


def test_the_pictures_are_of_their_moments(run, pictures):
    verdict = judge_run(run)
    assert [p.size for p in pictures.stills] == [opened(p.data).size for p in pictures.stills]
    first = pictures.stills[0]
    assert first.caption.startswith(f"At {verdict.lift_off_s + AFTER_LIFT_OFF_S:.2f} s")
    index = int(np.argmin(np.abs(run.truth["time_s"] - (verdict.lift_off_s + AFTER_LIFT_OFF_S))))
    for force in run.truth["normal_force"][index]:
        assert f"{force * 1e-3:.1f}" in first.caption
    assert np.array(opened(first.data)).std(axis=(0, 1)).min() > 10  # not blank


def test_views_are_side_by_side(pictures):
    assert opened(pictures.views.data).size == (3 * VIEW_SIZE[0], VIEW_SIZE[1])


def test_the_film_covers_the_run(run, pictures):
    film = pictures.film
    assert opened(film.sheet).size == (FILM_COLUMNS * FILM_SIZE[0], film.rows * FILM_SIZE[1])
    assert film.columns * film.rows == len(film.times_s) == FILM_FRAMES
    assert (film.times_s[0], film.times_s[-1]) == (run.truth["time_s"][0], run.truth["time_s"][-1])
    distance = np.abs(np.array(film.times_s) - judge_run(run).lift_off_s - AFTER_LIFT_OFF_S)
    assert film.start == int(np.argmin(distance))


def test_the_instant_nearest_in_time_is_drawn(run):
    time = run.truth["time_s"]
    between = float(0.7 * time[100] + 0.3 * time[101])
    np.testing.assert_array_equal(instant_at(run, between)["position"], run.truth["position"][100])


def test_a_rendered_picture_is_a_png_of_the_wanted_size(run):
    picture = opened(render(instant_at(run, 1.0), "l60", size=(320, 180)))
    assert (picture.format, picture.size) == ("PNG", (320, 180))


def without(run, **changes):
    columns = {name: changes.get(name, run.truth[name]) for name in run.truth}
    return replace(run, truth=Table(run.truth.source, {k: v for k, v in columns.items() if v is not None}))


def test_what_cannot_be_drawn_says_why(run):
    verdict = judge_run(run)
    assert "tilt_angle" in pictures_of(without(run, tilt_angle=None), verdict).missing
    assert "judged" in pictures_of(run, None).missing
    broken = run.truth["position"].copy()
    broken[5, 2] = np.nan
    assert "not finite" in pictures_of(without(run, position=broken), verdict).missing
