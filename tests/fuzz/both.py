"""The same random and mutated frames through the ECU in Python and in C: equal answers, and limits within what the machine and its state permit."""

import random
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path

from bus.frame import Frame
from dbc import loader_database
from dbc.binding import Binding
from deploy.c.core import C
from ecu import limits
from ecu.calibration import load_calibration
from ecu.core import PYTHON
from ecu.cycle import LEVER_LIMITS
from ecu.findings import EstimatorFailed, Finding
from ecu.outputs import CYCLE_VALUES
from ecu.states import State
from tests.deploy.c.beside import put_beside
from tests.deploy.c.random_drives import RandomDrive
from tests.ecu.machine import PERIOD_NS, FakeMachine
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.uds.tool import UdsEcu
from tests.ecu.uds.virtual_time import virtual_timers
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET
from tests.ecu.xcp.tool import Ecu as XcpEcu
from tests.fuzz.frames import FRAMES, Spoiler
from tests.fuzz.services import tool_frames, xcp_commands

CALIBRATION = load_calibration()
UNKNOWN = (State.INIT, State.FAULT)
"""States in which nobody knows how near the machine is to rolling over."""


@lru_cache(maxsize=1)
def bounds() -> dict[int, tuple[Binding, list[float], list[float]]]:
    """Identifier -> its limits' binding, the machine's own limits and the safe ones, as their frames carry them. SI."""
    found = {}
    rules = CALIBRATION.limits
    for message in ("Limits", "LinkageLimits"):
        codec = loader_database().by_name[message]
        names = {signal: name for signal, (_, name) in CYCLE_VALUES[message].items() if signal != "Cause"}
        binding = Binding(codec, {signal: CYCLE_VALUES[message][signal][0] for signal in names})
        # through the frame and back: the rounding to a signal's step is no excess
        both = [
            list(binding.decode(binding.encode([_by_name(each)[name] for name in names.values()])))
            for each in (limits.unlimited(rules, CALIBRATION.parameters.prediction), limits.safe(rules))
        ]
        found[codec.can_id] = (binding, both[0], both[1])
    return found


def _by_name(acting: limits.Limits) -> dict[str, float]:
    """Limits by the names of the values that go into frames."""
    return {
        "limit front torque": acting.front_torque,
        "limit rear torque": acting.rear_torque,
        "limit speed": acting.speed,
        "limit rate": acting.rate,
        **dict(zip(LEVER_LIMITS, acting.levers, strict=True)),
    }


def check_limits(frames: Iterable[Frame], state: State) -> None:
    """AssertionError where a limit is not available, below zero, or above the safe one in INIT and FAULT.

    None can be above the machine's own: there the signals' ranges end.
    """
    for frame in frames:
        if (found := bounds().get(frame.can_id)) is None:
            continue
        binding, own, safe = found
        for name, value, most in zip(
            binding.signals, binding.decode(frame.data), safe if state in UNKNOWN else own, strict=True
        ):
            assert 0.0 <= value <= most, f"{name} {value} in {state}"


def _said(findings: Iterable[Finding]) -> list[str]:
    # why estimators failed is an exception's text in Python and one bit in C; as text, because NaN equals nothing
    return ["failed" if isinstance(found, EstimatorFailed) else str(found) for found in findings]


def _spoiled(rng: random.Random) -> Iterator[tuple[Frame | None, int]]:
    """A standing machine's frames among bad ones, and ticks."""
    machine, spoiler, made = FakeMachine(), Spoiler(rng), 0
    while made < FRAMES:
        now = machine.now_ns
        for frame in machine.frames():
            for new in spoiler.spoiled(frame):
                made += 1
                yield new, now
        yield None, now + PERIOD_NS // 2


def through_both(number: int) -> tuple[int, int]:
    """One case: frames, and frames taken. Every other one is a random drive, in which the ECU runs; two of four test sensors against each other."""
    detects = number % 4 >= 2
    python, c = (core.ecu(CALIBRATION, detect_faults=detects) for core in (PYTHON, C))
    taken = 0
    rng = random.Random(f"both/{number}")
    calls = _spoiled(rng) if number % 2 else RandomDrive(CALIBRATION, rng.getrandbits(32)).calls(FRAMES)
    for frame, now in calls:
        if frame is not None:
            taken += 1
            assert _said(c.receive(frame, now)) == _said(python.receive(frame, now)), "findings differ"
            continue
        ours, theirs = c.tick(now), python.tick(now)
        assert [f[:2] for f in ours.frames] == [f[:2] for f in theirs.frames], "frames differ"
        assert _said(ours.findings) == _said(theirs.findings), "findings differ"
        check_limits(ours.frames, c.state)
    return taken, taken


class ServicesInBoth:
    """Commands of tools into XCP and UDS of both cores, with the key and without: equal answers, and equal frames of the cycles after them."""

    def __init__(self, library: Path) -> None:
        self._library = library

    def __call__(self, number: int) -> tuple[int, int]:
        """One case: frames of a tool, and frames of answers."""
        rng = random.Random(f"services in both/{number}")
        secret = SECRET if number % 3 else None
        if number % 2:
            ecu = put_beside(XcpEcu(secret=secret), self._library, secret=secret, xcp=XCP)
            return FRAMES, min(_through_xcp(ecu, rng), FRAMES)
        with virtual_timers(lambda: ecu.now_ns):
            ecu = put_beside(UdsEcu(secret=secret), self._library, secret=secret, uds=UDS)
            return FRAMES, min(_through_uds(ecu, rng), FRAMES)


def _through_xcp(ecu: XcpEcu, rng: random.Random) -> int:
    answered = 0

    def ask(packet: bytes) -> list[bytes]:
        nonlocal answered
        answers = ecu.answers(packet)
        answered += len(answers)
        return answers

    for _ in xcp_commands(rng, FRAMES, ask, SECRET):
        answered += len(ecu.cycles(1))
    return answered


def _through_uds(ecu: XcpEcu, rng: random.Random) -> int:
    return sum(len(ecu.cycles(1) if data is None else ecu.answers(data)) for data in tool_frames(rng, FRAMES))
