"""Work for the workers of tests: notes that it began, then does as the arm says."""

import os
import time
from pathlib import Path


def note(arm: dict[str, str]) -> dict[str, object]:
    """Append the arm and the worker's process to a file; 'wait': until a file is there; 'raise', 'miss': fail; 'die': end the process."""
    with Path(arm["log"]).open("a") as log:
        log.write(f"{arm['name']} {os.getpid()}\n")
    if arm.get("do") == "raise":
        raise ValueError("no such arm\nsecond line")
    if arm.get("do") == "miss":
        Path(f"{arm['log']}.none").read_text()
    if arm.get("do") == "die":
        os._exit(1)
    while "until" in arm and not Path(arm["until"]).exists():
        time.sleep(0.02)
    return {"name": arm["name"], "value": float(len(arm["name"]))}
