"""The description of a field test, `field.toml`, and its recordings: read, and written by the generator."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from configuration import CheckedTable
from identify.field.log import FieldLog, Somat, Vicon
from identify.reading import BadRecording, read_channels
from identify.tyre.parameters import Nominal
from identify.writing import write_columns

BAR = 1e5
VICON = {
    "x": ("X", "m"),
    "y": ("Y", "m"),
    "z": ("Z", "m"),
    "pitch": ("V", "rad"),
    "yaw": ("W", "rad"),
    "sync": ("sync", "V"),
}
SOMAT = {"angle": ("v", "rad"), "fx": ("F_x", "N"), "fy": ("F_y", "N"), "fz": ("F_z", "N")}
"""Column of each channel unless [vicon] or [somat] names another, and its SI unit."""


def read_field(path: Path, dbcs: Sequence[Path] = ()) -> FieldLog:
    """The log that a field.toml describes. Raises ConfigurationError, BadRecording."""
    table = CheckedTable.from_file(path)
    tyre, force = table.table("tyre"), table.table("force")
    systems = {}
    for name, known in (("vicon", VICON), ("somat", SOMAT)):
        part = table.table(name)
        units = part.table("units")
        file = part.beside("file")
        channels = {c: part.text(c, default=column) for c, (column, _) in known.items()}
        given = {c: units.text(c) for c in known if c in units.keys()}  # noqa: SIM118
        systems[name] = read_channels(
            file, channels, {c: unit for c, (_, unit) in known.items()}, given=given, dbcs=dbcs
        )
        units.finish()
        part.finish()
    map_of = table.beside("ground", default="ground.csv")
    log = FieldLog(
        name=table.text("name", default=path.parent.name),
        nominal=Nominal(
            load=tyre.number("nominal_load_N", unit="N", low=1e3, high=1e6),
            pressure=tyre.number("nominal_pressure_bar", unit="bar", low=0.3, high=15.0) * BAR,
            radius=tyre.number("unloaded_radius_m", unit="m", low=0.1, high=3.0),
        ),
        vicon=Vicon(time=systems["vicon"][0], **systems["vicon"][1]),
        somat=Somat(time=systems["somat"][0], **systems["somat"][1]),
        ground=_ground(map_of),
        wheel_weight=tyre.number("wheel_weight_N", unit="N", low=0.0, high=1e5, default=4190.0),
        gain_sd=force.number("gain_sd_percent", unit="%", low=0.0, high=20.0, default=0.5) / 100.0,
        radius_sd=tyre.number("radius_sd_mm", unit="mm", low=0.0, high=100.0, default=3.0) * 1e-3,
        standing_s=force.number("standing_s", unit="s", low=0.0, high=1e4, default=3.0),
    )
    for part in (tyre, force, table):
        part.finish()
    return log


def _ground(path: Path) -> np.ndarray:
    try:
        points = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise BadRecording(
            f"{path}: {error}; the map of the ground has columns X [m], Y [m], Z [m]"
        ) from error
    if points.shape[1] != 3 or points.shape[0] < 6:
        raise BadRecording(
            f"{path}: has {points.shape[0]} rows of {points.shape[1]}; the map of the ground needs six points or more of X, Y, Z [m]"
        )
    return points


def write_field(log: FieldLog, folder: Path, kind_of_file: str) -> list[Path]:
    """field.toml, both recordings and the ground; returns their paths, the description first."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [
        f'name = "{log.name}"',
        'ground = "ground.csv"',
        "",
        "[tyre]",
        f"nominal_load_N = {log.nominal.load!r}",
        f"nominal_pressure_bar = {log.nominal.pressure / BAR!r}",
    ]
    lines += [
        f"unloaded_radius_m = {log.nominal.radius!r}",
        f"wheel_weight_N = {log.wheel_weight!r}",
        f"radius_sd_mm = {1e3 * log.radius_sd!r}",
        "",
    ]
    lines += [
        "[force]",
        f"gain_sd_percent = {100.0 * log.gain_sd!r}",
        f"standing_s = {log.standing_s!r}  # at the start of the transducer's log",
        "",
    ]
    files = []
    for name, known, system in (("vicon", VICON, log.vicon), ("somat", SOMAT, log.somat)):
        file = folder / f"{name}.{kind_of_file}"
        write_columns(
            file,
            {
                "time [s]": system.time,
                **{f"{column} [{unit}]": getattr(system, c) for c, (column, unit) in known.items()},
            },
        )
        files.append(file)
        lines += [f"[{name}]", f'file = "{file.name}"', ""]
        if kind_of_file == "mat":
            lines += [f"[{name}.units]", *(f'{c} = "{unit}"' for c, (_, unit) in known.items()), ""]
    ground = folder / "ground.csv"
    ground.write_text(
        "X [m],Y [m],Z [m]\n"
        + "\n".join(",".join(repr(v) for v in row) for row in log.ground.tolist())
        + "\n",
        encoding="utf-8",
    )
    description = folder / "field.toml"
    description.write_text("\n".join(lines), encoding="utf-8")
    return [description, *files, ground]
