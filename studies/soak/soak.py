"""Random faults in lockstep, for hours of simulated time: which faults are detected, and does the ECU behave as declared?

Faults come one at a time, so that a detection belongs to one fault. Between faults nothing may be detected. At every tick the ECU's answer
must be in a declared state, reached by a declared transition, with every limit inside the DBC's range. Faults on the bus must never bring
the ECU into its fault state.
"""

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from configuration import CheckedTable
from dbc import loader_database
from ecu.states import TRANSITIONS, State
from hil.faults.passage import Fault
from hil.faults.table import SECOND, read_fault
from hil.lockstep import PERIOD_NS
from hil.timing.vitals import Life, judge_memory
from hil.verdict import Result, Verdict
from plant.unit.scenario import Scenario, load_scenario
from studies.soak import chance
from studies.soak.detection_matrix import DRIVE
from studies.soak.watch import Answer, Mechanism, Watch, Witness

EPISODE_S = 600.0
"""Longest drive; after it, or after a roll-over, a new machine and a new ECU start."""
SETTLED_S, FIRST_S = 1.0, 2.0  # start of the observation, and of the first fault
LASTS_S = (0.2, 2.5)  # range of a fault's duration
AFTERWARDS_S = 1.0
"""How long after its end a fault may be detected."""
QUIET_S = (0.5, 1.5)
"""Range of the time after that in which nothing may be detected."""
MOST_LINES = 50
LONGEST_TICK_NS = 10 * PERIOD_NS
"""After a longer silence another ECU process may answer, so the transition is not checked."""
ROUNDING = 1e-6
"""Tolerance of a decoded value: in floating point, 254 times 0.2 is slightly more than 50.8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Happened:
    """One fault of a soak."""

    fault: Fault
    struck: bool  # whether it changed a frame
    detected: frozenset[tuple[Witness, Mechanism]]  # who detected it, and how


@dataclass(slots=True)
class Reports:
    """Reports of things that must not happen: their number, and the first MOST_LINES of them."""

    count: int = 0
    lines: list[str] = field(default_factory=list)

    def add(self, line: str) -> None:
        """Add one report."""
        self.count += 1
        if len(self.lines) < MOST_LINES:
            self.lines.append(line)


@dataclass(slots=True)
class Soak:
    """The result of a soak."""

    seed: int
    simulated_s: float = 0.0
    episodes: int = 0  # drives
    rolled_over: int = 0  # drives that ended so
    faults: list[Happened] = field(default_factory=list)
    states: Counter[str] = field(default_factory=Counter)  # ticks by state of the ECU
    violations: Reports = field(default_factory=Reports)  # of the ECU's declared states and ranges
    unexplained: Reports = field(default_factory=Reports)  # detections without a fault
    doubt: str = ""  # why a busy host may have caused them; empty: it did not
    lives: tuple[Life, ...] = ()  # of the processes, in real time only

    @property
    def memory(self) -> Verdict | None:
        """The verdict on the growth of memory; None in lockstep, which has no processes of its own."""
        return judge_memory(self.lives) if self.lives else None

    @property
    def result(self) -> Result:
        """PASSED if the ECU behaved as declared, nothing was detected without a fault, and no process grew."""
        memory = self.memory.result if self.memory else Result.PASSED
        unexplained = self.unexplained.count > 0
        if self.violations.count or self.simulated_s <= 0 or memory is Result.FAILED:
            return Result.FAILED
        if unexplained and not self.doubt:
            return Result.FAILED
        return Result.INCONCLUSIVE if unexplained or memory is Result.INCONCLUSIVE else Result.PASSED


def soak(seconds: float, seed: int, progress: Callable[[float], None] = lambda done_s: None) -> Soak:
    """The result of a soak of `seconds` of simulated time; progress: called with the seconds done."""
    found = Soak(seed)
    while found.simulated_s < seconds:
        # a last drive of a second would hold no fault; it may end a little late instead
        left_s = max(seconds - found.simulated_s, FIRST_S + 10.0)
        _Episode(found, min(EPISODE_S, left_s)).run(progress)
    return found


class _Episode:
    """One drive from standstill."""

    def __init__(self, found: Soak, duration_s: float) -> None:
        generator = random.Random(f"{found.seed}/{found.episodes}")
        self._found = found
        self._duration_s = duration_s
        self._plan = [
            read_fault(CheckedTable(table, file="soak", section="fault"), loader_database())
            for table in plan(generator, duration_s)
        ]
        scenario = _scenario(generator, duration_s)
        self._watch = Watch(scenario, self._plan, seed=generator.randrange(2**32))
        self._keeper = Keeper(found)

    def run(self, progress: Callable[[float], None]) -> None:
        """Inject the faults one by one, with a quiet time between them."""
        found, watch = self._found, self._watch
        before_s = found.simulated_s
        self._until(round(SETTLED_S * SECOND))
        watch.forget()
        for number, fault in enumerate(self._plan, start=1):
            # between two faults: what is detected here has no cause
            self._until(fault.at_ns)
            self._nothing_detected()
            if not self._until(fault.at_ns + (fault.for_ns or 0) + round(AFTERWARDS_S * SECOND)):
                break
            struck = fault.kind == "kill" or watch.injector.first_struck_ns(number) is not None
            found.faults.append(
                Happened(fault=fault, struck=struck, detected=frozenset(watch.detected(fault.at_ns)))
            )
            watch.forget()
            found.simulated_s = before_s + watch.now_ns / SECOND
            progress(found.simulated_s)
        else:
            self._until(round(self._duration_s * SECOND))
            self._nothing_detected()
        found.episodes += 1
        found.rolled_over += watch.rolled_over
        found.simulated_s = before_s + watch.now_ns / SECOND

    def _until(self, time_ns: int) -> bool:
        """Simulate until `time_ns`; returns whether the drive continues then."""
        watch = self._watch
        while watch.now_ns < time_ns and not watch.finished:
            watch.step()
            self._keeper.check(watch.answers)
            watch.answers.clear()
            if not watch.sane:
                self._found.violations.add(self._at("the machine's motion is not finite"))
                return False
        return not watch.rolled_over

    def _nothing_detected(self) -> None:
        """Report everything that was detected since the last fault as unexplained, and clear it."""
        watch = self._watch
        for detection in watch.detections:
            self._found.unexplained.add(self._at(f"{detection.who}, {detection.mechanism}: {detection.what}"))
        for line in watch.late_messages():
            self._found.unexplained.add(self._at(f"{Witness.BENCH}, {Mechanism.DEADLINE}: {line}"))
        watch.forget()

    def _at(self, what: str) -> str:
        return f"drive {self._found.episodes + 1}, before {self._watch.now_ns / SECOND:.2f} s: {what}"


class Keeper:
    """Checks every answer of an ECU against the ranges of the DBC and the table of states."""

    def __init__(self, found: Soak) -> None:
        self._found = found
        self._ranges = {
            name: (signal.minimum, signal.maximum)
            for name, signal in loader_database().by_name["Limits"].by_signal.items()
            if signal.minimum is not None and signal.maximum is not None
        }
        self._before: Answer | None = None

    def check(self, answers: list[Answer]) -> None:
        """Check the answers of one tick, ordered by time."""
        for answer in answers:
            before, self._before = self._before, answer
            self._check_state(answer, before)
            for name, (lowest, highest) in self._ranges.items():
                if not lowest - ROUNDING <= answer.limits[name] <= highest + ROUNDING:
                    self._violate(
                        answer, f"Limits.{name} = {answer.limits[name]}, outside {lowest}..{highest}"
                    )

    def _check_state(self, answer: Answer, before: Answer | None) -> None:
        if answer.state not in tuple(State):
            self._violate(answer, f"state {answer.state} is not declared")
            return
        state = State(answer.state)
        self._found.states[state.name.lower()] += 1
        # that state is for a failed estimator; no fault on the bus may bring it about
        if state is State.FAULT:
            self._violate(answer, "in its fault state")
        if (
            before is None
            or answer.at_ns - before.at_ns > LONGEST_TICK_NS
            or before.state not in tuple(State)
        ):
            return  # a new ECU
        if state not in _reachable(State(before.state)):
            self._violate(answer, f"from {State(before.state).name} to {state.name} is not declared")

    def _violate(self, answer: Answer, what: str) -> None:
        self._found.violations.add(f"drive {self._found.episodes + 1}, {answer.at_ns / SECOND:.2f} s: {what}")


def _reachable(state: State) -> set[State]:
    """States after one tick, in which at most two events happen: on the inputs, and on the estimates.

    A fault that began in the tick lasts beyond it: recovery needs good inputs for a time.
    """
    once = _after(state)
    return once | {after for each in once if each is not State.FAULT for after in _after(each)}


def _after(state: State) -> set[State]:
    return set(TRANSITIONS[state].values())


def plan(
    generator: random.Random,
    duration_s: float,
    afterwards_s: Callable[[str], float] = lambda kind: AFTERWARDS_S,
    permitted: Callable[[chance.Table], bool] = lambda table: True,
) -> list[chance.Table]:
    """Tables of random faults, one after the other with quiet between them.

    afterwards_s: how long after its end a fault of a kind may be detected; permitted: others are drawn anew.
    """
    tables: list[chance.Table] = []
    at_s = FIRST_S
    while at_s + LASTS_S[1] + AFTERWARDS_S < duration_s:
        table = chance.fault(generator)
        # drawn anew, not changed: the others keep their shares
        if not permitted(table):
            continue
        for_s = round(generator.uniform(*LASTS_S), 2)
        tables.append(table | {"at_s": at_s, "for_s": for_s})
        after_s = afterwards_s(str(table["kind"])) + generator.uniform(*QUIET_S)
        at_s = round(at_s + for_s + after_s, 2)  # on a tick
    return tables


def _scenario(generator: random.Random, duration_s: float) -> Scenario:
    base = load_scenario(DRIVE)
    return replace(
        base,
        duration_s=duration_s,
        payload_mass=generator.uniform(0.0, 3000.0),
        script=chance.drive(generator, duration_s),
        start=replace(base.start, speed=0.0),
        seed=generator.randrange(2**32),
    )
