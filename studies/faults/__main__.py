"""python -m studies.faults --drives 12 --seconds 300 --manoeuvres 210 --out docs/results/faults.md"""

import argparse
import sys
from pathlib import Path

from studies.campaigns.batch import ROOT, results_of
from studies.campaigns.manoeuvres import drawn
from studies.faults.campaign import Case, Hard, run, run_hard
from studies.faults.document import page
from studies.faults.driven import keep, read_driven

SCENARIOS = ROOT / "plant" / "scenarios"


def main() -> int:
    """Run the campaign and write its page."""
    parser = argparse.ArgumentParser(prog="python -m studies.faults", description=__doc__)
    parser.add_argument("--drives", type=int, default=12, help="random drives, seeds from --first on")
    parser.add_argument("--first", type=int, default=5000, help="seed of the first drive")
    parser.add_argument("--seconds", type=float, default=300.0, help="length of a drive")
    parser.add_argument("--manoeuvres", type=int, default=210, help="drives of the campaign on prevention")
    parser.add_argument("--manoeuvre-seed", type=int, default=9001, help="seed they are drawn with")
    parser.add_argument(
        "--noise", type=int, default=2, help="seeds of the noise with which every drive case is driven"
    )
    parser.add_argument("--calibrations", type=int, default=3, help="wrong calibrations tried on every drive")
    parser.add_argument("--rounds", type=int, default=1, help="calibrations under which faults are injected")
    parser.add_argument("--jobs", type=int, default=None, help="processes; default: one per processor")
    parser.add_argument("--out", type=Path, default=Path("docs/results/faults.md"))
    parser.add_argument(
        "--keep", type=Path, default=None, help="also write what the drives say of false alarms, for --driven"
    )
    parser.add_argument(
        "--driven", type=Path, default=None, help="file of --keep, of an earlier commit: hours for the page"
    )
    chosen = parser.parse_args()
    cache, also = ROOT / "build" / "faults", sorted(Path(__file__).parent.glob("[a-z]*.py"))
    cases = [
        Case(chosen.first + k, chosen.seconds, chosen.calibrations, chosen.rounds)
        for k in range(chosen.drives)
    ]
    drives = drawn(chosen.manoeuvres, chosen.manoeuvre_seed)
    hard = [Hard(k, chosen.calibrations, manoeuvre) for k, manoeuvre in enumerate(drives)]
    hard += [
        Hard(k, chosen.calibrations, name=file.stem, seed=chosen.first + k)
        for file in sorted(SCENARIOS.glob("*.toml"))
        for k in range(chosen.noise)
    ]
    also = [file for file in also if file.name not in ("document.py", "campaign.py", "driven.py")]
    results = results_of(hard, run_hard, cache=cache, jobs=chosen.jobs, title="hard drives", also=also)
    results += results_of(cases, run, cache=cache, jobs=chosen.jobs, title="random drives", also=also)
    command = (
        f"python -m studies.faults --drives {chosen.drives} --first {chosen.first} --seconds {chosen.seconds:g} "
        f"--manoeuvres {chosen.manoeuvres} --manoeuvre-seed {chosen.manoeuvre_seed} --noise {chosen.noise} "
        f"--calibrations {chosen.calibrations} --rounds {chosen.rounds}"
    )
    if chosen.keep:
        keep(chosen.keep, results, command)
    driven = read_driven(chosen.driven) if chosen.driven else None
    chosen.out.write_text(page(results, chosen.calibrations, command, driven), encoding="utf-8")
    print(chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
