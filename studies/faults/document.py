"""The page of the campaign: what holds, then every signal and kind with its computed and its measured sizes."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from ecu.detection.rules import FAMILIES
from ecu.watched import NAMES
from studies.campaigns.batch import Result, header, markdown_table
from studies.campaigns.manoeuvres import KINDS as DRIVEN
from studies.faults.driven import Driven
from studies.faults.injected import KINDS, LASTS

UNITS: Final[Mapping[str, tuple[str, float]]] = {
    "articulation_angle": ("deg", np.degrees(1.0)),
    "articulation_rate": ("deg/s", np.degrees(1.0)),
    "wheel_speed": ("rad/s", 1.0),
    "wheel_torque": ("kN m", 1e-3),
    "specific_force": ("m/s2", 1.0),
    "angular_rate": ("deg/s", np.degrees(1.0)),
    "slope": ("deg", np.degrees(1.0)),
    "pressure": ("MPa", 1e-6),
    "linkage_angle": ("deg", np.degrees(1.0)),
    "steering_pressure": ("MPa", 1e-6),
}
ABOVE = 1.3
"""Faults from this multiple of the computed size on are above it: the size varies with speed and load of the moment."""
WORDS = f"""
The detection is on by default; `--no-detect-faults` switches it off.

Each fault lasts {LASTS / 100:g} s, in random drives with random payload, ground and sensor offsets, under a calibration whose masses are
wrong by up to 3 %, centres of gravity by 5 cm, radii by 1 %, stiffness by 15 %. *Computed* is the smallest size that the thresholds and
bounds in force while the fault lasts imply; a fault counts as above it from {ABOVE:g} times that size on. *Named* means
that the first answer names the faulty signal and no other; *in a set* that the answer is a set that contains it.
A drift is given per second, noise as its standard deviation, a swap as the difference of the two signals when it begins.
False alarms are counted with the ECU in the loop, and over its inputs once more with the right and with each wrong calibration.
"""
HARD: Final = (*DRIVEN, "drive case")


def page(results: Sequence[Result], calibrations: int, command: str, driven: Driven | None = None) -> str:
    """The whole page. driven: more drives without a fault."""
    outcomes = [outcome for result in results for outcome in result["outcomes"]]
    above = [o for o in outcomes if o["multiple"] >= ABOVE or o["kind"] == "freeze"]
    noticed = [o for o in above if o["noticed"]]
    return "\n".join(
        (
            header("Faults of sensors: noticed and named", command, "seeds as given") + WORDS,
            "## What must hold\n",
            markdown_table(
                ("question", "target", "measured"),
                (
                    ("faults above their computed size noticed", "95 %", _share(noticed, above)),
                    ("of these, the right signal named", "85 %", _share([o for o in noticed if o["alone"]], noticed)),
                    ("of these, a set named that contains it", "-", _share([o for o in noticed if o["among"]], noticed)),
                ),
            ),
            "## Without a fault\n",
            _false_alarms(results, calibrations, driven),
            "## The smallest offset that is noticed, by what the machine does\n",
            "Medians over moments of the drives (random drives: 10, 50 and 95 %), with the right calibration.\n",
            _by_manoeuvre(results),
            "## By kind\n",
            _by_kind(above),
            "## By signal and kind\n",
            _by_signal(outcomes),
        )
    )  # fmt: skip


def _false_alarms(results: Sequence[Result], calibrations: int, driven: Driven | None) -> str:
    """Drives, hours and alarms by kind of drive, with what the hours say of the rate, and every alarm."""
    rows, more = [], ""
    if driven:
        known = {result["what"] for result in results}
        # a drive that both runs had counts once, as this run had it
        results = [*results, *(r for r in driven.results if r["what"] not in known)]
        more = (
            f"Of these {len(results) - len(known)} drives are from `{driven.command}` at commit {driven.commit}: "
            f"they count as long as what makes an alarm has not changed.\n"
        )
    for kind in _driven(results):
        these = [r for r in results if r["kind"] == kind]
        wrong = sum(1 for r in these if r["alarms"])
        rows.append((kind, str(len(these)), f"{sum(r['hours'] for r in these):.2f}", str(wrong)))
    hours, wrong = sum(r["hours"] for r in results), sum(1 for r in results if r["alarms"])
    rows.append(("all", str(len(results)), f"{hours:.2f}", str(wrong)))
    said = f"Each drive counts once, however many of the {calibrations + 1} calibrations take a sound sensor for faulty.\n"
    said += more
    if not wrong:
        # none in T hours bounds a Poisson rate at -ln(0.05) / T, about 3 / T (rule of three)
        said += (
            f"Without one in {hours:.2f} h the rate is below {3.0 / hours:.2g} per hour at 95 % confidence.\n"
        )
    alarms = [f"- {r['what']}: {line}\n" for r in results for line in r["alarms"][:3]]
    table = markdown_table(("drives", "number", "hours", "with a false alarm"), rows)
    return "\n".join((table, said, "".join(alarms[:40])))


def _driven(results: Sequence[Result]) -> list[str]:
    """The kinds of drives that there are, random ones first."""
    return [kind for kind in ("random", *HARD) if any(result["kind"] == kind for result in results)]


def _by_manoeuvre(results: Sequence[Result]) -> str:
    """A row per signal: the computed smallest offset while the machine does this or that."""
    found: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for result in results:
        for name, values in result["sizes"].items():
            found[name, result["kind"]] += values
    rows, hard = [], [kind for kind in _driven(results) if kind != "random"]
    for name in NAMES:
        unit, factor = UNITS[FAMILIES[name]]
        calm = np.array(found[name, "random"] or [np.inf]) * factor
        sizes = [float(np.quantile(calm, share, method="lower")) for share in (0.1, 0.5, 0.95)]
        sizes += [float(np.median(found[name, kind] or [np.inf])) * factor for kind in hard]
        rows.append((f"{name} [{unit}]", *(f"{size:.3g}" if np.isfinite(size) else "none" for size in sizes)))
    return markdown_table(("signal", "random 10 %", "50 %", "95 %", *hard), rows)


def _share(some: Sequence[Any], of: Sequence[Any]) -> str:
    return f"{100.0 * len(some) / len(of):.1f} % ({len(some)} of {len(of)})" if of else "-"


def _by_kind(above: Sequence[Result]) -> str:
    rows = []
    for kind in KINDS:
        these = [o for o in above if o["kind"] == kind]
        noticed = [o for o in these if o["noticed"]]
        rows.append(
            (
                kind,
                _share(noticed, these),
                _share([o for o in noticed if o["alone"]], noticed),
                _share([o for o in noticed if o["among"]], noticed),
                f"{np.median([o['after_s'] for o in noticed]):.2f}" if noticed else "-",
            )
        )
    return markdown_table(("kind", "noticed", "named", "in a set", "after [s]"), rows)


def _by_signal(outcomes: Sequence[Result]) -> str:
    """A row per signal and kind: computed size and time, share noticed below, at and above it, measured time."""
    groups: defaultdict[tuple[str, str], list[Result]] = defaultdict(list)
    for outcome in outcomes:
        groups[outcome["signal"], outcome["kind"]].append(outcome)
    rows = []
    for name in NAMES:
        unit, factor = UNITS[FAMILIES[name]]
        for kind in KINDS:
            these = groups.get((name, kind), [])
            if not these:
                continue
            above = [o for o in these if o["multiple"] >= ABOVE or kind == "freeze"]
            # noticed below the computed size: the computation is too careful there, which is no failure
            below = [o for o in these if o["multiple"] < 1.0 and kind != "freeze"]
            noticed = [o for o in above if o["noticed"]]
            size = float(np.median([o["smallest"] for o in these])) * factor
            per = f"{size:.3g} {unit}{'/s' if kind == 'drift' else ''}" if kind != "freeze" else "any"
            times = [o["after_s"] for o in noticed]
            rows.append(
                (
                    f"{name}, {kind}",
                    per if np.isfinite(size) else "cannot be noticed",
                    f"{np.median([o['soon'] for o in these]):.2f}",
                    _short([o for o in below if o["noticed"]], below),
                    _short(noticed, above),
                    _short([o for o in noticed if o["alone"]], noticed),
                    _short([o for o in noticed if o["among"]], noticed),
                    f"{np.median(times):.2f}" if times else "-",
                )
            )
    return markdown_table(
        ("signal, kind", "computed size", "computed [s]", "noticed below it", "noticed above it", "named", "in a set", "after [s]"),
        rows,
    )  # fmt: skip


def _short(some: Sequence[Any], of: Sequence[Any]) -> str:
    return f"{len(some)} of {len(of)}" if of else "-"
