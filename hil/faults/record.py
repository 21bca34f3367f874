"""The faults of a run in its directory: faults.json, when each began and ended and how many frames it struck."""

import json
from collections.abc import Sequence
from pathlib import Path

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from hil.faults.injector import FaultEvent
from hil.faults.table import SECOND
from hil.rundir import FAULTS, RunError, writing


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid"))
class Injected:
    """One fault as it was; times [s] on the clock of the run.

    struck: frames that did not pass unchanged, and those the fault made. ended_s: None in the record
    of a run that was killed.
    """

    number: int
    fault: str
    began_s: float
    ended_s: float | None
    struck: int


_faults = TypeAdapter(list[Injected])


def injected(events: Sequence[FaultEvent], zero_ns: int = 0) -> list[Injected]:
    """The faults that began, in the order of their beginning. zero_ns: stamp of the start of the run."""
    found: dict[int, Injected] = {}
    for event in events:
        at_s = (event.at_ns - zero_ns) / SECOND
        if event.what == "begins":
            found[event.number] = Injected(event.number, event.label, at_s, None, event.struck)
        elif event.number in found:
            began_s = found[event.number].began_s
            found[event.number] = Injected(event.number, event.label, began_s, at_s, event.struck)
    return list(found.values())


def write_faults(path: Path, faults: Sequence[Injected]) -> None:
    """Write faults.json into the run directory `path`. RunError where that is impossible."""
    rows = [
        {"number": f.number, "fault": f.fault, "began_s": f.began_s, "ended_s": f.ended_s, "struck": f.struck}
        for f in faults
    ]
    part = path / f".{FAULTS}"
    with writing(path / FAULTS):
        part.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        part.replace(path / FAULTS)


def read_faults(path: Path) -> list[Injected]:
    """The faults of the run directory `path`; [] for a run without."""
    file = path / FAULTS
    if not file.exists():
        return []
    try:
        return _faults.validate_json(file.read_bytes())
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"])) or "file"
        raise RunError(f"{file}: {place}: {first['msg']}; was it damaged while being copied?") from None
