"""Writes and reads faults.json of a run directory: when each fault began and ended, and how many frames it affected."""

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
    """One fault that was injected. The names of the fields are the keys of the file."""

    number: int
    fault: str  # description, see `passage.Fault.label`
    began_s: float  # on the clock of the run [s]
    ended_s: float | None  # None in the record of a run that was killed
    struck: int  # frames that the fault changed, dropped, delayed or made


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
        # written beside and renamed: a killed run leaves the old file or the new one, never half of one
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
