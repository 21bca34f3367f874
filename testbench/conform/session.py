"""The stimulus of a conformance test on a live bus: which inputs are sent when. Pure: times and frames in, frames out.

    1  no input at all, until the node has sent for a while: its initial values
    2  every input: start-up, then steady traffic
    3  each input stays away in turn and comes back
    4  all inputs stay away and come back

Everything that is sent and received is kept; the verdicts come from that record (`judge`).
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from bus.frame import Frame
from dbc.database import Database
from testbench.conform.conduct import judge_conduct
from testbench.conform.evidence import Bench, Evidence
from testbench.conform.requirements import Requirement, judge_messages
from testbench.frames import table_of
from testbench.restbus.core import RestBus
from testbench.restbus.generators import Generator

MS = 1_000_000
ALONE_NS = 300 * MS
"""How long the node sends without inputs: three periods of the slowest message of a J1939 bus, 100 ms."""
QUIET_NS = 200 * MS
"""A bus on which the node was not heard for so long before its first frame: it was switched on while we listened."""
# Two periods of the slowest message (100 ms): the state that follows a change has then been sent twice.
SETTLE_NS = 200 * MS


def judge(evidence: Evidence) -> tuple[Requirement, ...]:
    """The verdicts on all requirements."""
    return (*judge_messages(evidence), *judge_conduct(evidence))


@dataclass(slots=True)
class _Step:
    """A stretch of the test: until this time, or earlier when the node says it is well."""

    until_ns: int
    until_running: bool = False
    hold_ns: int = 0
    """How long to go on after the node is well."""


@dataclass(slots=True)
class Session:
    """A conformance test that is going on.

    steady_s: length of the steady traffic [s]. only: inputs to lose, () for all that the DBC asks about.
    """

    database: Database
    node: str
    generators: Mapping[str, Generator]
    start_ns: int
    steady_s: float = 3.0
    only: tuple[str, ...] = ()
    record: list[Frame] = field(default_factory=list)
    first_ns: int | None = None
    phase: str = "waiting"
    _bus: RestBus | None = None
    _steps: Iterator[_Step] | None = None
    _step: _Step | None = None
    _state: str = ""
    _well_ns: int | None = None
    _now_ns: int = 0
    _own: dict[int, str] = field(default_factory=dict)
    finished: bool = False

    def __post_init__(self) -> None:
        # a wrong node name is refused here, before anybody is asked to switch something on
        Evidence.of(table_of([Frame(0, b"", self.start_ns)]), self.database, self.node)
        self._own = {c.can_id: n for n, c in self.database.by_name.items() if self.node in c.senders}

    @property
    def from_start(self) -> bool:
        """Whether the node was switched on while we listened."""
        return self.first_ns is not None and self.first_ns - self.start_ns >= QUIET_NS

    def receive(self, frames: Iterable[Frame], now_ns: int) -> None:
        """Take what came; stamps are the bus' own where it has any."""
        for frame in frames:
            stamped = frame if frame.at_ns else frame._replace(at_ns=now_ns)
            # foreign frames are kept too: the log must be the whole bus, and inputs may come from real nodes
            self.record.append(stamped)
            name = self._own.get(frame.can_id)
            if name is None:
                continue
            if self.first_ns is None:
                self.first_ns = stamped.at_ns
            self._note_state(name, frame)

    def _note_state(self, name: str, frame: Frame) -> None:
        conduct = self.database.nodes.get(self.node)
        message, _, signal = conduct.state_signal.partition(".") if conduct else ("", "", "")
        codec = self.database.by_name[name]
        # the state is followed only to save waiting; the verdicts read it from the record again
        if name != message or len(frame.data) != codec.length:
            return
        value = int(codec.decode_dict(frame.data).get(signal, -1))
        self._state = codec.by_signal[signal].choices.get(value, str(value))

    def advance(self, now_ns: int) -> list[Frame]:
        """The frames to send now; `finished` is set when the test is over."""
        if self.first_ns is None or self.finished:
            return []
        if self._steps is None:
            self._steps = self._script()
        self._now_ns = now_ns
        while self._step is None or self._over(self._step, now_ns):
            self._step = next(self._steps, None)
            self._well_ns = None
            if self._step is None:
                self.finished = True
                return []
            # The script works with times relative to the start of its steps.
            self._step.until_ns += now_ns
        if self._bus is None:
            return []
        frames = [frame._replace(at_ns=now_ns) for frame in self._bus.due(now_ns)]
        self.record += frames
        return frames

    def _over(self, step: _Step, now_ns: int) -> bool:
        # the limit of a step holds whether or not the node says anything
        if now_ns >= step.until_ns:
            return True
        conduct = self.database.nodes.get(self.node)
        if not step.until_running or conduct is None or self._state != conduct.running:
            self._well_ns = None
            return False
        if self._well_ns is None:
            self._well_ns = now_ns
        # well without a break: a node that flickers between states starts the time anew
        return now_ns - self._well_ns >= step.hold_ns

    def next_ns(self, now_ns: int) -> int:
        """When to be asked again [ns]."""
        due = self._bus.next_ns() if self._bus is not None else None
        # 10 ms: steps end on time also while nothing is sent
        return min(t for t in (due, now_ns + 10 * MS) if t is not None)

    def _script(self) -> Iterator[_Step]:
        """The steps; each begins when the generator goes on. until_ns is then relative to its beginning."""
        conduct = self.database.nodes.get(self.node)
        start_ns = conduct.start_ns if conduct else 0
        recovery_ns = max(conduct.recovery_ns if conduct else 0, SETTLE_NS)
        self.phase = "no inputs"
        # first without inputs: initial values are what the node sends before it has heard anything
        yield _Step(ALONE_NS)
        inputs = self._inputs()
        self.phase = "all inputs"
        if inputs:
            senders = {s for n in inputs for s in self.database.by_name[n].senders} - {self.node}
            bus = RestBus(self.database, senders, self.generators, start_ns=self._now_ns, without=[self.node])
            # only what the node receives: other messages of the same senders would load the bus and test nothing
            bus.stop(*(set(bus.messages) - set(inputs)))
            self._bus = bus
        yield _Step(start_ns + round(self.steady_s * 1e9))
        if self._bus is None:
            return
        # one after the other with a recovery between, so that each loss has its own state to show
        for name in self._to_lose(inputs):
            codec = self.database.by_name[name]
            self.phase = f"without {name}"
            self._bus.stop(name)
            # once the timeout until the state is due, then at least as long again to see that it stays
            yield _Step(codec.conduct.timeout_ns + max(codec.conduct.timeout_ns, SETTLE_NS))
            self.phase = f"{name} is back"
            self._resume([name])
            # a node that is well sooner shortens the test; the whole time is only spent on one that is not
            yield _Step(recovery_ns + SETTLE_NS, until_running=True, hold_ns=SETTLE_NS)
        self.phase = "without any input"
        sending = [name for name in inputs if name in self._bus.messages]
        self._bus.stop(*sending)
        longest = max((self.database.by_name[n].conduct.timeout_ns for n in inputs), default=0)
        yield _Step(longest + SETTLE_NS)
        self.phase = "all inputs are back"
        self._resume(sending)
        yield _Step(recovery_ns + SETTLE_NS)
        self.phase = "done"

    def _resume(self, names: Iterable[str]) -> None:
        assert self._bus is not None
        self._bus.resume(self._now_ns, *names)

    def _inputs(self) -> list[str]:
        return [
            name
            for name, codec in self.database.by_name.items()
            if self.node in codec.receivers and self.node not in codec.senders and codec.senders
        ]

    def _to_lose(self, inputs: list[str]) -> list[str]:
        asked = [name for name in inputs if self.database.by_name[name].conduct.state]
        return [name for name in asked if not self.only or name in self.only]

    def evidence(self, bench: Bench | None = None) -> Evidence:
        """The record so far, divided. bench: by default one that lost nothing and was never late."""
        bench = bench or Bench(from_start=self.from_start)
        return Evidence.of(table_of(self.record), self.database, self.node, bench)
