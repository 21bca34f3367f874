"""Every way a file can be wrong gives one error that names file, key, value, unit and range."""

import pytest

from configuration import CheckedTable, ConfigurationError


def table(**values: object) -> CheckedTable:
    return CheckedTable(values, file="a.toml", section="part")


def test_good_values_are_returned_and_all_keys_used_up():
    t = table(mass_kg=3, name="x", count=2, inner={"y": 1.5}, pair=[1, 2.5], ramp=[[0, 1], [2, 3]])
    assert t.number("mass_kg", unit="kg", low=0, high=5) == 3.0
    assert t.text("name") == "x"
    assert t.integer("count", low=0, high=2) == 2
    assert t.table("inner").number("y", unit="m") == 1.5
    assert t.numbers("pair", unit="m", count=2, low=0, high=3) == (1.0, 2.5)
    assert t.points("ramp", unit="m", low=0, high=3) == ((0.0, 1.0), (2.0, 3.0))
    t.finish()


def test_absent_keys_take_their_default_or_are_missing():
    assert table().number("mass_kg", unit="kg", default=7.0) == 7.0
    assert table().table("inner").keys() == []
    with pytest.raises(ConfigurationError, match=r"a\.toml: part\.mass_kg is missing"):
        table().number("mass_kg", unit="kg")


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda t: t.number("v", unit="kg", low=0, high=5), "a.toml: part.v = 9 kg is outside 0..5 kg"),
        (lambda t: t.integer("v", low=0, high=5), "a.toml: part.v = 9 is outside 0..5"),
        (lambda t: t.text("v"), "a.toml: part.v = 9 is not a text"),
        (lambda t: t.table("v"), "a.toml: part.v = 9 is not a table"),
        (
            lambda t: t.points("v", unit="m", low=0, high=1),
            "a.toml: part.v = 9 is not a list of [time_s, value] pairs",
        ),
        (
            lambda t: t.numbers("v", unit="m", count=2, low=0, high=1),
            "a.toml: part.v = 9 is not a list of 2 numbers of m",
        ),
    ],
)
def test_a_wrong_value_is_named(read, message):
    with pytest.raises(ConfigurationError) as error:
        read(table(v=9))
    assert str(error.value) == message


@pytest.mark.parametrize("value", [True, "3", None, [1]])
def test_only_numbers_are_numbers(value):
    with pytest.raises(ConfigurationError, match=r"part\.v"):
        table(v=value).number("v", unit="kg")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_outside_any_range(value):
    with pytest.raises(ConfigurationError, match="outside"):
        table(v=value).number("v", unit="kg", low=0, high=5)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[0, 1], [2]], ["part.v[1]", "pair"]),
        ([[1, 1], [0.5, 1]], ["part.v[1].time", "0.5 s", "1..inf s"]),
        ([[-1, 1]], ["part.v[0].time", "-1 s"]),
        ([[0, 8]], ["part.v[0].value", "8 m", "0..1 m"]),
        ([], ["part.v"]),
    ],
)
def test_a_wrong_point_is_named_with_its_number(points, words):
    with pytest.raises(ConfigurationError) as error:
        table(v=points).points("v", unit="m", low=0, high=1)
    assert all(word in str(error.value) for word in words)


def test_a_key_nobody_asked_for_is_refused_with_the_nearest_known_one():
    t = table(friktion=0.5)
    t.number("friction", unit="1", default=0.75)
    with pytest.raises(
        ConfigurationError, match=r"part\.friktion is not a known key; did you mean 'friction'\?"
    ):
        t.finish()


def test_a_file_that_cannot_be_read_or_parsed_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"gone\.toml: cannot be read"):
        CheckedTable.from_file(tmp_path / "gone.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("a = 1\nb = \n")
    with pytest.raises(ConfigurationError, match=r"bad\.toml: not valid TOML: .*line 2"):
        CheckedTable.from_file(bad)
    bad.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigurationError, match=r"bad\.toml: cannot be read"):
        CheckedTable.from_file(bad)


@pytest.mark.parametrize("read", [lambda t: t.number("v", unit="m"), lambda t: t.one_or_more("v")])
def test_a_whole_number_that_no_float_holds_is_refused_by_its_length(read):
    with pytest.raises(
        ConfigurationError, match=r"^a\.toml: part\.v = a whole number of 401 digits is too large$"
    ):
        read(table(v=10**400))
