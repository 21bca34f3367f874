"""Many cases on all processors, each result kept until the code or the case changes.

A campaign that was interrupted goes on where it stopped; one whose code is unchanged costs nothing.
"""

import dataclasses
import hashlib
import json
import os
import subprocess
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

ROOT = Path(__file__).resolve().parents[2]
# What a lockstep run is made of. Too much here only costs a run anew, too little keeps wrong results.
SOURCES = (
    "bus", "dbc", "deploy/c", "ecu", "plant",
    "hil/compose.py", "hil/ecu_side.py", "hil/judgement.py", "hil/lockstep.py", "hil/verdict.py",
)  # fmt: skip
SUFFIXES = (".py", ".toml", ".dbc", ".c", ".h")
Result = dict[str, Any]


def results_of(
    cases: Sequence[Any],
    run: Callable[..., Result],
    *given: Any,
    cache: Path,
    jobs: int | None = None,
    title: str = "",
    also: Sequence[Path] = (),
) -> list[Result]:
    """The result of every case, in their order.

    cases: frozen dataclasses of plain values; run: a function of a module, deterministic, whose
    result is plain values too; given: its further arguments, the same for every case. Results are kept in `cache`, one small file per case; also: more modules that they depend on.
    """
    # once for all cases: reading the sources takes longer than a look into the cache
    code = digest_of_sources(Path(run.__code__.co_filename), *also)
    files = [cache / f"{_key(case, code, *map(repr, given))}.json" for case in cases]
    missing = [index for index, file in enumerate(files) if not file.exists()]
    cache.mkdir(parents=True, exist_ok=True)
    # spawn: a fork would copy locks that threads of this process hold, those of compiled code and of the progress bar
    with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        pending = {pool.submit(run, cases[index], *given): files[index] for index in missing}
        console = Console(stderr=True)  # the command's result goes to standard output alone
        for future in track(as_completed(pending), description=title, total=len(pending), console=console):
            _keep(pending[future], future.result())
    # read back also where just made: new and kept results pass the same way, and cannot differ in type
    return [json.loads(file.read_text()) for file in files]


def _key(case: Any, *settings: str) -> str:
    # names of the fields are in the key as well: a campaign that gains a parameter does not take old results for new ones
    text = json.dumps([type(case).__name__, dataclasses.asdict(case), *settings], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _keep(file: Path, result: Result) -> None:
    # renamed when complete, so that an interrupted campaign leaves no half file under the name
    part = file.with_suffix(".part")
    part.write_text(json.dumps(result))
    part.replace(file)


def digest_of_sources(*campaign: Path) -> str:
    """A digest of everything a case depends on except the Python packages: the cores and the campaign's modules."""
    digest = hashlib.sha256()
    for file in sorted({*campaign, *_source_files()}):
        digest.update(str(file.relative_to(ROOT)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _source_files() -> list[Path]:
    found: list[Path] = []
    for path in (ROOT / source for source in SOURCES):
        # generated modules beside machine code are no source, and appear while a first case compiles
        found += (
            [path]
            if path.is_file()
            else [f for f in path.rglob("*") if f.suffix in SUFFIXES and "__pycache__" not in f.parts]
        )
    return found


def header(title: str, command: str, seeds: str) -> str:
    """The first lines of a table: how to make it again, and from which commit it is."""
    return f"# {title}\n\nMade by `{command}` at commit {commit()}, {seeds}.\n"


def commit() -> str:
    """The commit of the code, and whether files were changed since."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)
        return done.stdout.strip() if done.returncode == 0 else ""

    name = git("rev-parse", "--short=10", "HEAD")
    if not name:
        return "unknown (not a git checkout)"
    # only files that decide the figures: a changed page of documentation is no reason for a warning
    changed = git("status", "--porcelain", "--", *SOURCES, "studies")
    return f"{name} with uncommitted changes" if changed else name


def markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; the first column is text, the others are figures."""
    ruler = ["---", *["---:"] * (len(headings) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (headings, ruler, *rows)) + "\n"
