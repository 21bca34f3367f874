"""Machine code of the plant is kept for the next process."""

import subprocess
import sys

from plant.compiled import DIGEST


def test_every_process_finds_the_same_code():
    """Generated modules lie beside the code; were they sources of it, no process would find the code of the one before."""
    script = "import plant.effects.dispatch; from plant.compiled import DIGEST; print(DIGEST)"
    printed = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [one.stdout.strip() for one in printed] == [DIGEST, DIGEST]
