"""The gallery of real recordings in docs/gallery: small models of published data, what the tool says of them, and what is known.

    python -m bench.gallery [NAME ...] [--out docs/gallery]

For a reader who wants to see the tool on machines that were not made for it. Verdicts are written as they come, right or wrong.
"""

import argparse
import io
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from bench.exhibits import EXHIBITS, Exhibit, model_and_recordings, model_file
from bench.proof.real import folder
from diagnosis import describe
from discrepancy.decision.evidence import Evidence, evidence
from discrepancy.decision.judgement import Judgement
from discrepancy.examine import investigate
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings

PLOTTED = 2_400  # points of a curve at most; more is a file of megabytes


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="exhibits; default: all")
    parser.add_argument("--out", type=Path, default=Path("docs/gallery"))
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    for exhibit in EXHIBITS:
        if not chosen.names or exhibit.name in chosen.names:
            (chosen.out / f"{exhibit.name}.md").write_text(_shown(exhibit, chosen.out), encoding="utf-8")


def _shown(exhibit: Exhibit, out: Path) -> str:
    """The page of one exhibit; its picture is written beside it."""
    # as the command line does, so that the command on the page gives what the page says
    settings, start = Settings(average=exhibit.average), time.perf_counter()
    model, recordings = model_and_recordings(exhibit, folder())
    judged = investigate(model, recordings, settings, lambda _: None, [])
    # a recording that cannot be judged has no page: its data or its model are broken
    if not isinstance(judged, Judgement):
        raise SystemExit(f"{exhibit.name}: {judged.reasons}")
    seconds = time.perf_counter() - start
    _draw(evidence(judged, settings), out / f"{exhibit.name}.svg")
    return _page(exhibit, judged.findings, seconds)


def _page(exhibit: Exhibit, found: Findings, seconds: float) -> str:
    model = model_file(exhibit)
    place = "out" if exhibit.prepare else f"FOLDER/{exhibit.name}"
    files = " ".join(f"{place}/{file}" for file in exhibit.files)
    commands = [
        f"    loaderhil diagnose {files} --model {model}{' --average' * exhibit.average} --out out/{exhibit.name}"
    ]
    if exhibit.prepare:
        commands.insert(0, f"    python -m {exhibit.prepare.__module__} FOLDER/{exhibit.name} {files}")
    rows = [
        f"| {describe.alternatives(f, several=len(found.recordings) > 1)} | {'cause' if f.named else 'best proxy'} | {'; '.join(map(describe.estimate, f.parameters[:2]))} |"
        for f in found.findings
    ]
    table = ["| effect | found as | size |", "|---|---|---|", *rows, ""] if rows else []
    title = exhibit.name.replace("_", " ").capitalize()
    return "\n".join(
        [
            f"# {title}",
            "",
            f"{exhibit.story} [The model]({'../' * 2}{model}) has {len(model.read_text(encoding='utf-8').splitlines())} lines.",
            "",
            *commands,
            "",
            f"**The tool says: {found.status}.** {'; '.join(found.reasons)}.",
            "",
            *table,
            f"**Known:** {exhibit.known}",
            "",
            f"**Compared:** {exhibit.judgement}",
            "",
            f"![recorded minus simulated, before and after]({exhibit.name}.svg)",
            "",
            f"{found.samples} samples, {found.simulations} simulations, {seconds:.0f} s. Written by `python -m bench.gallery {exhibit.name}`.",
            "",
        ]
    )


def _draw(shown: Evidence, file: Path) -> None:
    """Recorded minus simulated of every recording's first channel, before and after, on held-out segments."""
    # one channel: the others are on the page that the command writes
    first = [t for t in shown.traces if t.channel == shown.traces[0].channel]
    # a fixed salt and no date: the same figures give the same file
    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": file.stem, "font.size": 9}):
        figure, panels = plt.subplots(
            len(first), 1, figsize=(9.0, 1.9 * len(first)), layout="constrained", squeeze=False
        )
        for axes, trace in zip(panels[:, 0], first, strict=True):
            every = max(1, trace.time_s.size // (PLOTTED // len(first)))
            time_s, recorded = trace.time_s[::every], trace.recorded[::every]
            axes.plot(
                time_s, recorded - trace.before[::every], color="#c25a00", linewidth=0.7, label="before"
            )
            if trace.after is not None:
                axes.plot(
                    time_s, recorded - trace.after[::every], color="#0072b2", linewidth=0.7, label="after"
                )
            axes.set_title(trace.recording, fontsize=9, loc="left")
            axes.set_ylabel(f"{trace.channel} [{trace.unit}]")
            axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        panels[-1, 0].set_xlabel("time [s]")
        figure.legend(
            *panels[0, 0].get_legend_handles_labels(), loc="outside upper right", frameon=False, ncols=2
        )
        # drawn in memory first: a run that is cut off leaves the picture of the run before, not an empty file
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        plt.close(figure)
    file.write_bytes(drawn.getvalue())


if __name__ == "__main__":
    main()
