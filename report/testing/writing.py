"""Writes a page in one step: a reader sees the old or the new one, never half."""

from pathlib import Path

from hil.rundir import writing


def write_page(text: str, file: Path) -> Path:
    """The file; RunError when it cannot be written."""
    part = file.with_name(f".{file.name}.part")
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_text(text, encoding="utf-8")
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)
    return file
