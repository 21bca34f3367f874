"""python -m studies.faults --drives 12 --seconds 300 --out docs/results/faults.md"""

import argparse
import sys
from pathlib import Path

from studies.campaigns.batch import ROOT, results_of
from studies.faults.campaign import Case, run
from studies.faults.document import page


def main() -> int:
    """Run the campaign and write its page."""
    parser = argparse.ArgumentParser(prog="python -m studies.faults", description=__doc__)
    parser.add_argument("--drives", type=int, default=12, help="random drives, seeds from --first on")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first drive")
    parser.add_argument("--seconds", type=float, default=300.0, help="length of a drive")
    parser.add_argument("--calibrations", type=int, default=4, help="wrong calibrations tried on every drive")
    parser.add_argument("--rounds", type=int, default=1, help="calibrations under which faults are injected")
    parser.add_argument("--jobs", type=int, default=None, help="processes; default: one per processor")
    parser.add_argument("--out", type=Path, default=Path("docs/results/faults.md"))
    chosen = parser.parse_args()
    cases = [
        Case(chosen.first + k, chosen.seconds, chosen.calibrations, chosen.rounds)
        for k in range(chosen.drives)
    ]
    results = results_of(cases, run, cache=ROOT / "build" / "faults", jobs=chosen.jobs, title="drives")
    command = (
        f"python -m studies.faults --drives {chosen.drives} --first {chosen.first} --seconds {chosen.seconds:g} "
        f"--calibrations {chosen.calibrations} --rounds {chosen.rounds}"
    )
    chosen.out.write_text(page(results, chosen.calibrations, command), encoding="utf-8")
    print(chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
