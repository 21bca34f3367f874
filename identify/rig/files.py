"""The description of a rig's log, `rig.toml`, and its runs: read, and written by the generator."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from configuration import CheckedTable
from identify.reading import BadRecording, read_channels
from identify.rig.log import KINDS, PistonCalibration, RigLog, RigRun
from identify.tyre.parameters import Nominal
from identify.writing import write_columns

BAR = 1e5
CHANNELS = {"cylinder_speed": ("V_cyl", "m/s"), "force": ("F_x", "N"), "shaft_speed": ("n_cs", "rad/s")}
"""Column of each channel unless [channels] names another, and its SI unit."""


def read_rig(path: Path, dbcs: Sequence[Path] = ()) -> RigLog:
    """The log that a rig.toml describes. Raises ConfigurationError, BadRecording."""
    table = CheckedTable.from_file(path)
    tyre, force, piston, names, units = (
        table.table(key) for key in ("tyre", "force", "calibration", "channels", "units")
    )
    channels = {name: names.text(name, default=column) for name, (column, _) in CHANNELS.items()}
    given = {name: units.text(name) for name in CHANNELS if name in units.keys()}  # noqa: SIM118
    nominal = Nominal(
        load=tyre.number("nominal_load_N", unit="N", low=1e3, high=1e6),
        pressure=tyre.number("nominal_pressure_bar", unit="bar", low=0.3, high=15.0) * BAR,
        radius=tyre.number("unloaded_radius_m", unit="m", low=0.1, high=3.0),
    )
    readings = piston.values.get("piston_pressure_bar", [])
    count = len(readings) if isinstance(readings, list) else 0
    calibration = PistonCalibration(
        piston_pressure=np.array(
            piston.numbers("piston_pressure_bar", unit="bar", count=count, low=0.0, high=300.0)
        )
        * BAR,
        loaded_radius=np.array(piston.numbers("loaded_radius_m", unit="m", count=count, low=0.05, high=3.0)),
        radius_sd=piston.number("radius_sd_mm", unit="mm", low=0.0, high=100.0) * 1e-3,
        q1=piston.number("qfz1", unit="1", low=0.01, high=1e4),
        q2=piston.number("qfz2", unit="1", low=-1e4, high=1e4, default=0.0),
        stiffness_sd=piston.number("stiffness_sd_percent", unit="%", low=0.0, high=50.0) / 100.0,
    )
    log = RigLog(
        name=table.text("name", default=path.parent.name),
        nominal=nominal,
        calibration=calibration,
        gain_sd=force.number("gain_sd_percent", unit="%", low=0.0, high=20.0, default=0.5) / 100.0,
        shortest_relaxation=tyre.number("shortest_relaxation_m", unit="m", low=1e-3, high=1.0, default=0.05),
        runs=[_run(path, run, channels, given, dbcs) for run in table.tables("run")],
    )
    for part in (tyre, force, piston, names, units, table):
        part.finish()
    if not log.runs:
        raise BadRecording(f"{path}: has no [[run]]")
    repeated = [run.name for i, run in enumerate(log.runs) if run.name in {r.name for r in log.runs[:i]}]
    if repeated:
        raise BadRecording(f"{path}: the run {repeated[0]} is given twice; its evidence would count twice")
    return log


def _run(
    path: Path, table: CheckedTable, channels: dict[str, str], given: dict[str, str], dbcs: Sequence[Path]
) -> RigRun:
    file = table.beside("file")
    kind = table.choice("kind", KINDS) if "kind" in table.keys() else ""  # noqa: SIM118
    piston, inflation = (
        table.number(key, unit="bar", low=0.0, high=300.0) * BAR
        for key in ("piston_pressure_bar", "inflation_bar")
    )
    table.finish()
    time, values = read_channels(
        file,
        channels,
        {n: unit for n, (_, unit) in CHANNELS.items()},
        given=given,
        dbcs=dbcs,
    )
    return RigRun(
        name=file.name.removesuffix(".gz").rpartition(".")[0],
        kind=kind,
        time=time,
        cylinder_speed=values["cylinder_speed"],
        force=values["force"],
        shaft_speed=values["shaft_speed"] / (2.0 * math.pi),
        piston_pressure=piston,
        inflation=inflation,
    )


def write_rig(log: RigLog, folder: Path, kind_of_file: str) -> list[Path]:
    """rig.toml and the files of its runs; returns their paths, the description first."""
    c, n = log.calibration, log.nominal
    lines = [
        f'name = "{log.name}"', "", "[tyre]", f"nominal_load_N = {n.load!r}", f"nominal_pressure_bar = {n.pressure / BAR!r}",
        f"unloaded_radius_m = {n.radius!r}", f"shortest_relaxation_m = {log.shortest_relaxation!r}", "",
        "[force]", f"gain_sd_percent = {100.0 * log.gain_sd!r}  # certificate of the transducer", "",
        "[calibration]  # loaded radius over the piston's pressure, and the vertical stiffness that makes loads of it",
        f"piston_pressure_bar = {(c.piston_pressure / BAR).tolist()}", f"loaded_radius_m = {c.loaded_radius.tolist()}",
        f"radius_sd_mm = {1e3 * c.radius_sd!r}", f"qfz1 = {float(c.q1)!r}", f"qfz2 = {float(c.q2)!r}", f"stiffness_sd_percent = {100.0 * c.stiffness_sd!r}", "",
    ]  # fmt: skip
    if kind_of_file == "mat":
        lines += ["[units]", 'cylinder_speed = "m/s"', 'force = "N"', 'shaft_speed = "rev/s"', ""]
    files = []
    for run in log.runs:
        file = folder / "runs" / f"{run.name}.{kind_of_file}"
        write_columns(
            file,
            {
                "time [s]": run.time,
                "V_cyl [m/s]": run.cylinder_speed,
                "F_x [N]": run.force,
                "n_cs [rev/s]": run.shaft_speed,
            },
        )
        files.append(file)
        lines += [
            "[[run]]",
            f'file = "runs/{file.name}"',
            f"piston_pressure_bar = {run.piston_pressure / BAR!r}",
            f"inflation_bar = {run.inflation / BAR!r}",
        ]
        lines += [f'kind = "{run.kind}"', ""] if run.kind else [""]
    description = folder / "rig.toml"
    description.write_text("\n".join(lines), encoding="utf-8")
    return [description, *files]
