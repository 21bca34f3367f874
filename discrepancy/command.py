"""`diagnose`: recordings and a model's name in, findings on the terminal and in findings.json out. The only shell here.

Exit codes: 0 nothing missing or explained, 1 unknown or inconclusive, 2 misused (no such model or recording).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from discrepancy.findings import Findings, to_json
from discrepancy.judge import judge, nothing_usable
from discrepancy.model import Model
from discrepancy.models import ball, car, road
from discrepancy.problem import Problem, Unusable
from discrepancy.recording import Recording
from discrepancy.search import Progress, Settings
from discrepancy.words import tell


class Misuse(ValueError):
    """The command line asks for something that is not there; the message says what is."""


@dataclass(frozen=True, slots=True)
class Source:
    """How one model reads its recordings; `folder` says what the argument is."""

    read: Callable[[Path, str | None], list[Recording]]
    model: Callable[[Sequence[Recording]], Model]
    argument: str


def _read_ball(path: Path, part: str | None) -> list[Recording]:
    if part is None:
        raise Misuse(f"--model ball needs --part with the ball's name: {', '.join(ball.WEIGHED)}")
    return ball.load_drops(_folder(path), part)


def _read_car(path: Path, part: str | None) -> list[Recording]:
    files = sorted(path.glob("*.csv.gz")) if path.is_dir() else [path]
    if not files:
        raise Misuse(f"{path}: no *.csv.gz in this folder")
    return [car.load_dart(file, reference=part != "on-board") for file in files]


def _model_car(recordings: Sequence[Recording]) -> Model:
    return car.model(reference=all("speed_reference" in r.signals for r in recordings))


def _read_road(path: Path, _: str | None) -> list[Recording]:
    return [road.load_comma(_folder(path))]


def _folder(path: Path) -> Path:
    if not path.is_dir():
        raise Misuse(f"{path} is not a folder")
    return path


SOURCES = {
    "ball": Source(
        _read_ball, lambda _: ball.model(), "folder with ball_drops.csv and balls.txt, and --part BALL"
    ),
    "dart": Source(
        _read_car, _model_car, "DART csv(.gz) file or folder; --part on-board leaves motion capture out"
    ),
    "road": Source(_read_road, road.model, "folder of the comma2k19 minute with its DBC"),
}


def read(recordings: Sequence[Path], model: str, part: str | None = None) -> tuple[Model, list[Recording]]:
    """Read what the paths hold for a model. Raises Misuse with what is missing and what would be right."""
    if model not in SOURCES:
        raise Misuse(
            f"no model {model!r}; there are {', '.join(f'{n} ({s.argument})' for n, s in SOURCES.items())}"
        )
    source = SOURCES[model]
    found: list[Recording] = []
    for path in recordings:
        if not path.exists():
            raise Misuse(f"{path} does not exist; --model {model} reads a {source.argument}")
        try:
            found += source.read(path, part)
        except (OSError, ValueError, KeyError, EOFError) as error:
            raise Misuse(f"{path}: cannot be read for --model {model}: {error}") from error
    if not found:
        raise Misuse("no recordings given")
    return source.model(found), found


def examine(
    model: Model, recordings: Sequence[Recording], settings: Settings, progress: Progress = lambda _: None
) -> Findings:
    """The verdict on recordings that were read, usable or not."""
    try:
        problem = Problem(model, recordings)
    except Unusable as error:
        return nothing_usable(model.name, [r.name for r in recordings], error)
    return judge(problem, settings, progress)


def diagnose(
    recordings: Sequence[Path],
    *,
    model: str,
    part: str | None = None,
    out: Path | None = None,
    settings: Settings | None = None,
    console: Console | None = None,
) -> int:
    """Run the engine, tell the result, write findings.json to `out` (a file or a folder). Returns the exit code."""
    console = console or Console()
    try:
        chosen, found = read(recordings, model, part)
    except Misuse as error:
        console.print(f"[red]{error}[/]", highlight=False)
        return 2
    with console.status("reading") as status:
        result = examine(chosen, found, settings or Settings(), lambda text: status.update(text))
    tell(result, console)
    if out is not None:
        target = out / "findings.json" if out.suffix != ".json" else out
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(to_json(result))
        console.print(f"written: {target}", highlight=False)
    return 0 if result.status in ("explained", "nothing missing") else 1
