"""Tests run stricter than use: floating-point trouble is an error."""

import os
from pathlib import Path

import numpy as np
import pytest

np.seterr(divide="raise", over="raise", invalid="raise")

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder with the public recordings: $LOADERHIL_DATA, or ../shared/data beside the checkout."""
    folder = Path(os.environ.get("LOADERHIL_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}; set LOADERHIL_DATA or run scripts/fetch-data")
    return folder
