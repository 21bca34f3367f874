"""Runs of benchmarks that counted, kept per commit: a page that could not be finished takes them up."""

import json
from dataclasses import asdict
from pathlib import Path

from bench.speed_load import Load


def kept(folder: Path, name: str) -> tuple[str, Load] | None:
    """What a benchmark printed when it last ran undisturbed, and its load; None if it has not, or its file is damaged."""
    try:
        record = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        return str(record["printed"]), Load(**record["load"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(folder: Path, name: str, printed: str, load: Load) -> None:
    """Keep a run; whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    part = folder / f"{name}.part"
    part.write_text(json.dumps({"printed": printed, "load": asdict(load)}), encoding="utf-8")
    part.replace(folder / f"{name}.json")
