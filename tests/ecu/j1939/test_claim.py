"""Claims of one address, as laws: at any times and with any NAMEs one controller has it in the end, and it is that of the lowest NAME."""

import itertools
import random

import pytest

from bus.frame import EXTENDED, FD, REMOTE, Frame
from dbc.j1939 import source_address
from ecu.j1939.claim import ADDRESS_CLAIMED, CONTENTION_NS, DELAY_NS, NULL, AddressClaim, State, message

ADDRESS = 0x80
TICK_NS = 10_000_000
LONGEST_DELAY_NS = 255 * DELAY_NS


def claimed(name: int, address: int = ADDRESS) -> Frame:
    return message(ADDRESS_CLAIMED, address, name.to_bytes(8, "little"))


def owner(name: int, address: int = ADDRESS, delay: int = 7) -> AddressClaim:
    claim = AddressClaim(name, address, lambda: delay)
    claim.start(0)
    claim.pending(CONTENTION_NS)
    assert claim.state is State.OWNED
    return claim


def test_the_claim_carries_the_name_to_all():
    (frame,) = AddressClaim(0x0123456789ABCDEF, ADDRESS, lambda: 0).start(0)
    # J1939-81: PGN 60928 to all, priority 6, the least significant byte of the NAME first
    assert frame.can_id == EXTENDED | 0x18EEFF80
    assert frame.data == bytes.fromhex("efcdab8967452301")


@pytest.mark.parametrize(
    ("address", "wait_ns"), [(0x80, CONTENTION_NS), (247, CONTENTION_NS), (127, 0), (248, 0)]
)
def test_an_address_in_the_middle_is_used_only_after_time_for_objections(address, wait_ns):
    claim = AddressClaim(5, address, lambda: 0)
    claim.start(1000)
    if wait_ns:
        claim.pending(1000 + wait_ns - 1)
        assert claim.state is State.CLAIMING
    claim.pending(1000 + wait_ns)
    assert claim.state is State.OWNED


@pytest.mark.parametrize("now_ns", [0, CONTENTION_NS], ids=["claiming", "owned"])
def test_a_higher_name_is_answered_by_our_claim(now_ns):
    claim = AddressClaim(5, ADDRESS, lambda: 0)
    claim.start(0)
    claim.pending(now_ns)
    before = claim.state
    assert claim.receive(claimed(6), now_ns) == [claimed(5)]
    assert claim.state is before


@pytest.mark.parametrize("other", [4, 5], ids=["lower", "same"])
def test_a_lower_name_takes_the_address_and_the_same_one_too(other):
    """Two units with one NAME are wrong; both silent is safe, both sending is not."""
    claim = owner(5, delay=7)
    assert claim.receive(claimed(other), 10**9) == []
    assert (claim.state, claim.lost_to) == (State.LOST, other)
    assert claim.pending(10**9 + 7 * DELAY_NS - 1) == []
    assert claim.pending(10**9 + 7 * DELAY_NS) == [claimed(5, NULL)]
    assert claim.pending(10**10) == []
    # it stays lost, whatever comes
    assert claim.receive(claimed(9), 10**10) == []
    assert claim.state is State.LOST


def test_another_address_is_none_of_ours():
    claim = owner(5)
    assert claim.receive(claimed(4, 0x81), 0) == []
    assert claim.state is State.OWNED


@pytest.mark.parametrize(
    "frame",
    [
        claimed(4)._replace(data=b"\0" * 7),
        claimed(4)._replace(can_id=claimed(4).can_id | REMOTE),
        claimed(4)._replace(can_id=claimed(4).can_id & ~EXTENDED & 0x7FF),
        claimed(4)._replace(flags=FD),
        Frame(EXTENDED | 0x18EFFF80, bytes(8)),
    ],
    ids=["short", "remote", "11 bits", "FD", "another group"],
)
def test_what_is_no_claim_takes_nothing(frame):
    claim = owner(5)
    assert claim.receive(frame, 0) == []
    assert claim.state is State.OWNED


def test_who_asks_is_told():
    claim = AddressClaim(5, ADDRESS, lambda: 3)
    assert claim.requested(0) == []  # not yet on the bus
    claim.start(0)
    assert claim.requested(1) == [claimed(5)]
    claim.receive(claimed(4), 2)
    claim.pending(LONGEST_DELAY_NS + 2)
    assert claim.requested(10**9) == []
    assert claim.pending(10**9 + 3 * DELAY_NS) == [claimed(5, NULL)]


@pytest.mark.parametrize("seed", range(50))
def test_in_the_end_the_lowest_name_alone_has_the_address(seed):
    """Two to five controllers that start at any time, every frame heard by all others up to a tick later."""
    draw = random.Random(seed)
    names = list({draw.getrandbits(64) for _ in range(draw.randint(2, 5))})
    starts = [draw.randrange(0, 2 * CONTENTION_NS, TICK_NS // 10) for _ in names]
    claims = [AddressClaim(name, ADDRESS, lambda: draw.randrange(256)) for name in names]
    on_the_wire: list[tuple[int, AddressClaim, Frame]] = []
    sent: list[Frame] = []
    for now in range(0, 2 * CONTENTION_NS + 10**9, TICK_NS // 10):
        heard = [item for item in on_the_wire if item[0] <= now]
        on_the_wire = [item for item in on_the_wire if item[0] > now]
        for claim, start in zip(claims, starts, strict=True):
            frames = claim.start(now) if now == start else []
            frames += itertools.chain(*(claim.receive(f, now) for _, by, f in heard if by is not claim))
            frames += claim.pending(now)
            on_the_wire += [(now + draw.randrange(1, TICK_NS), claim, frame) for frame in frames]
            sent += frames
    # who starts after others have the address meets their claims only if somebody answers: the lowest always does
    states = dict(zip(names, (claim.state for claim in claims), strict=True))
    assert states.pop(min(names)) is State.OWNED
    assert set(states.values()) == {State.LOST}
    assert len(sent) < 4 * len(names) ** 2  # no storm of claims
    assert sum(source_address(frame.can_id) == NULL for frame in sent) == len(names) - 1
