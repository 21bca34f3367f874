"""candump's filter syntax: what is read, what is refused; what passes is tested beside candump itself."""

import pytest

from bus.frame import ERROR, EXTENDED, REMOTE
from hil.monitor.filters import INVERTED, FilterError, Filters
from hil.monitor.target import Target, TargetError


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        ("123:7FF", (0x123, 0x7FF)),
        ("123~7FF", (0x123 | INVERTED, 0x7FF)),
        ("12345678:DFFFFFFF", (0x92345678, 0xDFFFFFFF)),
        ("00000123:7FF", (0x123, 0x7FF)),
        ("123:C00007FF", (0x123, 0xC00007FF)),
        ("123:DFFFFFFF", (0x123, 0xC00007FF)),  # an 11-bit filter looks at 11 bits
        ("0:20000000", (0, 0)),  # error frames have a filter of their own
    ],
)
def test_pairs_are_the_kernels(text: str, pair: tuple[int, int]) -> None:
    assert Filters.parse([text]).pairs == (pair,)


@pytest.mark.parametrize(
    "text", ["", "123", "123:", ":7FF", "123:7FF:1", "xyz:7FF", "#", "#xyz", "123456789:1", "jj"]
)
def test_what_is_no_filter_is_named(text: str) -> None:
    with pytest.raises(FilterError, match=f"filter '{text}': not ID:MASK"):
        Filters.parse(["123:7FF", text])


def test_any_of_several_filters_or_all_of_them() -> None:
    either, both = Filters.parse(["100:100", "200:200"]), Filters.parse(["100:100", "200:200", "j"])
    assert [either.passes(can_id) for can_id in (0, 0x100, 0x200, 0x300)] == [False, True, True, True]
    assert [both.passes(can_id) for can_id in (0, 0x100, 0x200, 0x300)] == [False, False, False, True]


def test_error_frames_need_their_mask() -> None:
    plain, masked, joined = (
        Filters(),
        Filters.parse(["0~0", "#4"]),
        Filters.parse(["1:1", "2:2", "j", "#FFF"]),
    )
    assert not plain.passes(ERROR | 4)
    assert plain.passes(EXTENDED | 4)
    assert plain.passes(REMOTE | 4)
    assert masked.passes(ERROR | 0x44)
    assert not masked.passes(ERROR | 0x40)
    assert not masked.passes(0x44)
    assert not joined.passes(ERROR | 4)


def test_a_target_is_a_bus_an_interface_or_a_file(tmp_path) -> None:
    log = tmp_path / "a,b.log"
    log.touch()
    assert Target.parse(str(log)).path == log
    plain = tmp_path / "c.log"
    plain.touch()
    assert Target.parse(f"{plain},123:7FF").filters.pairs == ((0x123, 0x7FF),)
    hub = Target.parse("hub:/tmp/some.hub,123:7FF")
    assert (hub.name, hub.address, hub.filters.pairs) == ("some", "hub:/tmp/some.hub", ((0x123, 0x7FF),))
    assert Target.parse("hub:@bench").name == "bench"
    assert Target.parse("can0").address == "socketcan:can0"
    assert Target.parse("socketcan:can0,j").interface == "can0"


@pytest.mark.parametrize("text", ["", "missing.log", "dir/file", "tcp:host", "hub:", ",123:7FF"])
def test_what_is_neither_is_said_so(text: str) -> None:
    with pytest.raises(TargetError, match="no such file, and no bus"):
        Target.parse(text)
