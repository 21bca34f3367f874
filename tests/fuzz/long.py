"""The long run: blocks of cases in processes of their own, under limits of time and memory; it can be ended and taken up again.

A block's process tells the number of the case that it is about to begin. Where one hangs, or takes the process with it, the case is
noted as a defect, and the block goes on behind it in a new process.
"""

import contextlib
import ctypes
import json
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tests.fuzz.outcome import LONGEST_S, MOST_MIB, Case, Outcome, carried_out

START_S = 900.0
"""Longest start of a process [s]: what it reads with may be compiled first."""


@dataclass(slots=True)
class State:
    """What has been carried out so far, and its file."""

    file: Path
    commit: str
    done: dict[str, Outcome] = field(default_factory=dict)
    """By target."""
    cases: dict[str, int] = field(default_factory=dict)
    """Number of the first case of a target that has not been carried out."""

    @classmethod
    def taken_up(cls, file: Path, commit: str) -> "State":
        """The state in the file if it is of the same commit, else an empty one: figures of two versions are not added up."""
        state = cls(file, commit)
        if file.exists():
            kept = json.loads(file.read_text(encoding="utf-8"))
            if kept["commit"] == commit:
                state.cases = kept["cases"]
                state.done = {name: _outcome(values) for name, values in kept["done"].items()}
        return state

    def add(self, name: str, outcome: Outcome, next_case: int) -> None:
        """Take in a block and write the file."""
        self.done.setdefault(name, Outcome()).add(outcome)
        self.cases[name] = next_case
        content = {
            "commit": self.commit,
            "cases": self.cases,
            "done": {n: asdict(o) for n, o in self.done.items()},
        }
        self.file.parent.mkdir(parents=True, exist_ok=True)
        partial = self.file.with_suffix(".partial")
        partial.write_text(json.dumps(content), encoding="utf-8")
        partial.replace(self.file)


def _outcome(values: dict[str, Any]) -> Outcome:
    return Outcome(**values | {"defects": [(number, what) for number, what in values["defects"]]})


def block(name: str, first: int, count: int) -> Outcome:
    """`count` cases of a target, numbered from `first`, each process of the block limited in time and memory."""
    outcome, end = Outcome(), first + count
    while first < end:
        part, first = _process(name, first, end - first)
        outcome.add(part)
    return outcome


def _process(name: str, first: int, count: int) -> tuple[Outcome, int]:
    """What one process carried out before its end, and the first case that is left to do."""
    context = multiprocessing.get_context("spawn")
    at, (ours, theirs) = context.Value(ctypes.c_int64, -1), context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(name, first, count, at, theirs))
    process.start()
    theirs.close()
    last, since = -1, time.monotonic()
    while not ours.poll(0.5):
        if at.value != last:
            last, since = at.value, time.monotonic()
        elif time.monotonic() - since > (START_S if last < 0 else 2 * LONGEST_S):
            process.kill()
            break
    # at the end of a process that was killed the pipe ends, which also counts as readable
    try:
        outcome = ours.recv()
        left = first + count
    except EOFError:
        process.join()
        if at.value < 0:
            raise RuntimeError(
                f"the process for {name!r} ended with {process.exitcode} before its first case"
            ) from None
        what = f"the process ended with {process.exitcode}, or was ended after {2 * LONGEST_S:.0f} s"
        # The cases before it are carried out again: their figures went with the process, and numbers repeat exactly.
        outcome = block(name, first, at.value - first)
        outcome.add(Outcome(1, defects=[(at.value, what)]))
        left = at.value + 1
    process.join()
    ours.close()
    return outcome, left


def _work(name: str, first: int, count: int, at: Any, answer: Connection) -> None:
    with tempfile.TemporaryDirectory() as folder, case_of(name, Path(folder)) as case:
        # beyond the limit Python raises MemoryError, which no reader may let out
        limit = _data_bytes() + (MOST_MIB << 20)
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))

        def begin(number: int) -> None:
            at.value = number

        # once before anything is measured: the libraries that a first case loads are not what its input takes
        begin(first)
        with contextlib.suppress(Exception):
            case(first)
        answer.send(carried_out(case, first, count, begin))


def _data_bytes() -> int:
    line = next(line for line in _status() if line.startswith("VmData"))
    return int(line.split()[1]) << 10


def _status() -> Iterator[str]:
    yield from Path("/proc/self/status").read_text(encoding="ascii").splitlines()


def case_of(name: str, folder: Path) -> AbstractContextManager[Case]:
    """What carries out the cases of a target. folder: for its files or its socket."""
    from tests.fuzz.frames import RECEIVERS
    from tests.fuzz.readers import MutatedFiles

    return RECEIVERS[name](folder) if name in RECEIVERS else nullcontext(MutatedFiles(name, folder))
