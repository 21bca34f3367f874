"""`python -m bench.proof [--arms straight,ball] [--share 0.1]`: carry out the arms that are left, and write the report."""

import argparse
import shlex
from pathlib import Path

from rich.console import Console

from bench.proof import report
from bench.proof.arm import LOADERS, read
from bench.proof.plan import GROUPS, PARTS, carried_out, plan, sampled
from diagnosis.fleet.cluster import carry_out
from diagnosis.fleet.fleet import bar
from diagnosis.fleet.store import Store


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.proof", description=__doc__)
    parser.add_argument(
        "--arms",
        default=",".join(GROUPS),
        help=f"of {', '.join(GROUPS)}; {', '.join(PARTS)}: of the loader's",
    )
    parser.add_argument("--seeds", type=int, default=3, help="repetitions of the whole plan")
    parser.add_argument("--share", type=float, default=1.0, help="of the arms, evenly from each kind")
    parser.add_argument(
        "--loader-share", type=float, default=0.06, help="of the loader's arms, which take minutes each"
    )
    parser.add_argument(
        "--work", type=Path, default=Path("out/proof"), help="keeps each arm's result; run again to take up"
    )
    parser.add_argument("--out", type=Path, default=None, help="write the report here, else print it")
    parser.add_argument("--workers", type=int, default=None, help="processes; else one per processor")
    parser.add_argument(
        "--scheduler", default=None, help="address of a dask scheduler; else processes of this machine"
    )
    parser.add_argument("--report-only", action="store_true", help="of the arms that are there")
    args = parser.parse_args()
    groups = args.arms.split(",")
    if strange := [group for group in groups if group not in GROUPS + PARTS]:
        parser.error(f"--arms {strange[0]}: there are {', '.join(GROUPS + PARTS)}")
    planned = list(plan(groups, args.seeds))
    # a whole machine takes minutes per arm, a small body seconds
    quick, slow = [a for a in planned if a.body not in LOADERS], [a for a in planned if a.body in LOADERS]
    chosen = {a.key: a for a in (*sampled(quick, args.share), *sampled(slow, args.share * args.loader_share))}
    version = report.commit()
    # results of another commit are not mixed with these: they are other software's
    store = Store(args.work, {"commit": version})
    failures: dict[str, str] = {}
    if not args.report_only:
        with bar(Console(stderr=True)) as progress:
            failures = carry_out(
                carried_out, chosen, store, scheduler=args.scheduler, workers=args.workers, report=progress
            ).failures
    store.collect(chosen, failures)
    note = (
        f"{len(chosen)} arms were chosen of {len(planned)}, evenly by seed."
        if len(chosen) < len(planned)
        else ""
    )
    # only what decides the figures: folders and workers do not belong into the command on the page
    chosen_by = ("arms", "seeds", "share", "loader_share")
    options = [
        f"--{name.replace('_', '-')}={value}"
        for name in chosen_by
        if (value := getattr(args, name)) != parser.get_default(name)
    ]
    command = shlex.join(["python", "-m", "bench.proof", *options])
    text = report.report(
        [read(row) for row in store.rows(chosen)],
        failures,
        len(chosen),
        command,
        {"commit": version, "note": note},
    )
    report.publish(text, args.out)


if __name__ == "__main__":
    main()
