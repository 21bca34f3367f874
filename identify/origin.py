"""Where the results of an identification come from: the command and the commit."""

import subprocess
from pathlib import Path


def origin_of(command: str) -> str:
    """The command, and the commit of the sources where they are a checkout."""
    folder = Path(__file__).resolve().parent
    try:
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=folder, capture_output=True, text=True, check=False
        ).stdout.strip()
    except OSError:
        commit = ""
    return f"{command}{f' (commit {commit})' if commit else ''}"
