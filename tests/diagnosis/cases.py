"""Files for `loaderhil diagnose`, made from the tank of tests/discrepancy."""

import csv
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from discrepancy.signals.findings import Candidate, Estimate, Finding, Findings, GroupMember, Where, from_json
from discrepancy.signals.recording import Recording
from loaderhil import cli

MODEL = "from tests.discrepancy.toys import tank\nmodel = tank({})\n"


@dataclass(frozen=True, slots=True)
class Ended:
    """How a call of the command line ended."""

    code: int
    out: str
    err: str
    result: Findings | None


Call = Callable[..., Ended]


@pytest.fixture
def loaderhil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Call the command line as a user does; findings.json is read back where one was written."""

    def call(*words: object, folder: Path | None = None) -> Ended:
        folder = folder or tmp_path / f"out{len(list(tmp_path.glob('out*')))}"
        monkeypatch.setattr(sys, "argv", ["loaderhil", *map(str, words), "--out", str(folder)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capsys.readouterr()
        code = ended.value.code
        found = folder / "findings.json"
        result = from_json(found.read_text()) if found.is_file() else None
        return Ended(int(code) if code is not None else 0, said.out, said.err, result)

    return call


def model_file(folder: Path, *effects: str) -> Path:
    """A FILE.py with the tank; effects: its library, all if none."""
    path = folder / "tank.py"
    path.write_text(MODEL.format(", ".join(map(repr, effects))))
    return path


def columns(recording: Recording) -> dict[str, np.ndarray]:
    """Headed columns of a recording of the tank."""
    inflow, level = recording.signals["inflow"], recording.signals["level"]
    return {"time [s]": inflow.time_s, "inflow [m/s]": inflow.value, "level [m]": level.value}


def write_csv(path: Path, table: Mapping[str, np.ndarray], separator: str = ",", decimal: str = ".") -> Path:
    """All columns of one length; NaN becomes an empty cell."""
    with path.open("w", newline="") as stream:
        out = csv.writer(stream, delimiter=separator)
        out.writerow(table)
        for row in zip(*(c.tolist() for c in table.values()), strict=True):
            out.writerow(["" if np.isnan(v) else repr(float(v)).replace(".", decimal) for v in row])
    return path


def unseen(effect: str, reason: str = "") -> Candidate:
    """An effect that could not be judged."""
    return Candidate(
        effect=effect,
        kind="physics",
        verdict="could not be judged",
        statistic=0.0,
        p_value=1.0,
        expected=[],
        power=0.0,
        confounded_share=0.0,
        reason=reason,
    )


def finding(
    effect: str,
    kind: Literal["physics", "sensor"],
    values: Mapping[str, float],
    *,
    named: bool = True,
    group: Sequence[str] = (),
    interval: tuple[float, float] = (0.0, 1.0),
) -> Finding:
    """A finding with these parameters; a member of its group has the first of them, under its own name."""
    parameters = [
        Estimate(name=n, value=v, low=interval[0], high=interval[1], unit="1") for n, v in values.items()
    ]
    return Finding(
        effect=effect,
        named=named,
        caveats=[],
        kind=kind,
        place="",
        sentence="",
        equation="",
        parameters=parameters,
        sse_reduction=1.0,
        threshold=1.0,
        held_out_sse_reduction=1.0,
        gap_closed=1.0,
        confounded_share=0.0,
        held_out_error={},
        group=[
            GroupMember(
                effect=g,
                likelihood_difference=0.0,
                collinearity=1.0,
                parameters=[replace(parameters[0], name=g)],
            )
            for g in group
        ],
        separate_by=[],
        where=Where(channels={}, throughout=True, intervals=[], regimes=[]),
    )
