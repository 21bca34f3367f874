"""Compiles the detection like the estimators: one source for the live loop and for columns, same results as Python."""

from pathlib import Path

from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler

_FOLDER = Path(__file__).resolve().parent
_BESIDE = [_FOLDER.parent / name for name in ("watched.py", "detection_rules.py")]
_SOURCES = [*_FOLDER.rglob("*.py"), *(_FOLDER.parent / "estimators").rglob("*.py"), *_BESIDE]

compiled = compiler(code_folder(_FOLDER, "detection", digest_of(sorted(_SOURCES))), fastmath=False)
"""Kept by the sources of the estimators too: the residuals call their equations."""
