"""Keys laid over files act as if they stood in them, and are refused in the same words."""

from dataclasses import replace

import pytest

from configuration import ConfigurationError
from plant.sheets.changes import UNCHANGED, Changes
from plant.sheets.machine import load_machine
from plant.unit.scenario import load_scenario

BEND = """
name = "bend"
sentence = "A bend."
duration_s = 5.0
machine = "l60"
[surface]
friction = 0.75
[driver.speed_kmh]
points = [[0.0, 5.0]]
"""


def change(*words):
    return Changes.of(words)


@pytest.fixture
def bend(tmp_path):
    """Writes the scenario with some text replaced, in a folder of its own."""

    def write(old="", new="", folder="as_is"):
        path = tmp_path / folder / "bend.toml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(BEND.replace(old, new) if old else BEND)
        return path

    return write


@pytest.mark.parametrize(
    ("word", "old", "new"),
    [
        ("surface.friction=0.4", "friction = 0.75", "friction = 0.4"),
        ("duration_s = 7", "duration_s = 5.0", "duration_s = 7"),
        ("driver.speed_kmh.points=[[0.0, 5.0], [2.0, 9.0]]", "[[0.0, 5.0]]", "[[0.0, 5.0], [2.0, 9.0]]"),
        ("sensors.yaw_rate.bias_deg_s=1.5", "[surface]", "[sensors.yaw_rate]\nbias_deg_s = 1.5\n[surface]"),
        ("sentence=Another", '"A bend."', '"Another"'),
        ('sentence="A = B"', '"A bend."', '"A = B"'),
    ],
)
def test_a_changed_key_acts_as_if_it_stood_in_the_file(bend, word, old, new):
    written, changed, plain = (
        replace(load_scenario(path, changes), path=None, changes=UNCHANGED)
        for path, changes in (
            (bend(old, new, "written"), UNCHANGED), (bend(), change(word)), (bend(), UNCHANGED),
        )
    )  # fmt: skip
    assert repr(changed) == repr(written)
    assert repr(changed) != repr(plain)
    assert load_scenario(bend(), change(word)).changes.words == (word,)


def test_of_two_words_for_one_key_the_later_holds(bend):
    words = ("duration_s=7", "surface.friction=0.4", "duration_s=8")
    scenario = load_scenario(bend(), change(*words))
    assert (scenario.duration_s, scenario.surface.friction) == (8.0, 0.4)


def test_machine_and_equipment_are_reached_by_their_names(bend):
    changes = change("machine.steering.time_constant_s=0.03", "equipment.limits.stale_after_ms=70")
    assert load_scenario(bend(), changes).equipment.obedience.stale_after == pytest.approx(0.07)
    plain, machine = load_machine("l60"), load_machine("l60", changes.machine)
    assert plain.steering.time_constant != 0.03
    assert machine == replace(plain, steering=replace(plain.steering, time_constant=0.03))


def test_machine_alone_is_the_scenarios_own_key(bend):
    assert load_scenario(bend(), change("machine=compact")).machine == "compact"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("surface.friction=9", r"bend\.toml with --set: surface\.friction = 9 1 is outside 0\.05\.\.1\.2 1"),
        ("surface.frction=0.4", r"with --set: surface\.frction is not a known key; did you mean 'friction'"),
        ("duration_s=long", r"duration_s = 'long' is not a number of s"),
        ("duration_s.most=3", r"duration_s\.most: duration_s = 5\.0 is not a table"),
        (
            "equipment.limits.stale_after_ms=5",
            r"l60\.toml with --set: limits\.stale_after_ms = 5 ms is outside",
        ),
    ],
)
def test_a_wrong_change_is_refused_in_the_words_of_the_file(bend, word, message):
    with pytest.raises(ConfigurationError, match=message):
        load_scenario(bend(), change(word))


def test_a_wrong_change_of_the_machine_names_its_file_and_range():
    changes = change("machine.steering.time_constant_s=-1").machine
    with pytest.raises(
        ConfigurationError, match=r"l60\.toml with --set: steering\.time_constant_s = -1 s is outside"
    ):
        load_machine("l60", changes)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("friction", r"--set friction: is not KEY=VALUE"),
        ("=3", r"--set =3: is not KEY=VALUE"),
        ("surface..friction=3", r"is not KEY=VALUE"),
        ("driver.speed_kmh.points=[[0,", r"points=\[\[0,: the value is not TOML"),
        ("seed=1\nmachine='x'", r"the value is not TOML"),
        ("seed=", r"the value is not TOML"),
        ("fault.kind=drop", r"faults come with the scenario's file or with --inject"),
    ],
)
def test_a_word_that_is_no_change_is_refused(word, message):
    with pytest.raises(ConfigurationError, match=message):
        change(word)
