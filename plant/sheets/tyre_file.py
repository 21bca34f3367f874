"""A tyre property file (.tir: MF-Tyre 5.x, 6.x or PAC2002) as the [tyre] table of a machine file.

The Magic Formula of the plant (plant/physics/tyre.py) has a part of such a file's coefficients. What it lacks and the file has is
refused group by group, unless the machine file lists it under `leave_out`: `tir = "tyre.tir"`, `leave_out = ["camber", ...]`.
Signs: the plant's lateral force is positive with the tangent of the slip angle, so PDY1 and PKY1 become positive.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from configuration import Change, CheckedTable, ConfigurationError

GROUPS = {
    "camber": "PDX3 PDY3 PEY3 PEY4 PEY5 PKY3 PKY4 PKY5 PKY6 PKY7 PPY5 PHY3 PVY3 PVY4 QBZ4 QBZ5 QDZ3 QDZ4 QDZ8 QDZ9 QDZ10 QDZ11 "
    "QEZ5 QHZ3 QHZ4 SSZ3 SSZ4 RBX3 RBY4 RVY3",
    "shifts": "PHX1 PHX2 PVX1 PVX2 PHY1 PHY2 PVY1 PVY2 QHZ1 QHZ2 RHX1 RHY1 RHY2 RBY3",
    "aligning": "QBZ2 QBZ3 QBZ9 QBZ10 QDZ6 QDZ7 QEZ1 QEZ2 QEZ3 QEZ4 SSZ1 SSZ2 QTZ1 PPZ1 PPZ2",
    "combined": "REX2 REY1 REY2 RVY1 RVY2 RVY4 RVY5 RVY6",
    "overturning": "QSX1 QSX2 QSX3 QSX4 QSX5 QSX6 QSX7 QSX8 QSX9 QSX10 QSX11 PPMX1",
    "rolling": "QSY1 QSY2 QSY3 QSY4 QSY5 QSY6 QSY7 QSY8",
    "relaxation": "PTX1 PTX2 PTX3 PTY1 PTY2",
}
"""Coefficients that the plant's tyre has not, by what they are about."""

MACHINERY = {
    "friction_ellipse": "[MODEL] FE_METHOD = 'YES': combined forces by the friction ellipse",
    "load_curve": "[DEFLECTION_LOAD_CURVE]: the normal force from a table instead of VERTICAL_STIFFNESS",
    "scaling": "scale factors other than 1",
}
"""Further groups that may be left out."""

SAME = (
    "PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX3", "PEX4", "PKX1", "PKX2", "PKX3", "PPX1", "PPX2", "PPX3", "PPX4",
    "PCY1", "PEY1", "PEY2", "PKY2", "PPY1", "PPY2", "PPY3", "PPY4", "RBX1", "RBX2", "RCX1", "REX1", "RBY1", "RBY2", "RCY1", "QBZ1", "QCZ1", "QDZ1", "QDZ2",
)  # fmt: skip
"""Coefficients that mean the same here and there; one that a file has not is 0."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?")
_SCALE = re.compile(r"L[A-Z]{1,4}")  # LFZO, LMUX, LSGKP, ...; LONGVL is a speed
_UNITS = {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second"}


@dataclass(frozen=True, slots=True)
class TyreFile:
    """A .tir file: numbers and words by key, tables by section (rows of numbers)."""

    path: Path
    numbers: Mapping[str, float]
    words: Mapping[str, str]
    tables: Mapping[str, tuple[tuple[float, ...], ...]]

    def number(self, key: str) -> float:
        """A number that has to be there."""
        if key not in self.numbers:
            raise ConfigurationError(f"{self.path}: has no {key}: is it a tyre property file?")
        return self.numbers[key]


def read_tir(path: Path) -> TyreFile:
    """Read a .tir file. Raises ConfigurationError with file and line, also for units other than SI."""
    try:
        text = path.read_text(encoding="latin-1")
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
    numbers: dict[str, float] = {}
    words: dict[str, str] = {}
    tables: dict[str, list[tuple[float, ...]]] = {}
    section = ""
    for line, raw in enumerate(text.splitlines(), 1):
        content = re.split(r"[!$]", raw, maxsplit=1)[0].strip()
        if not content or content.startswith("{"):
            continue
        if content.startswith("["):
            section = content.strip("[] ").upper()
        elif "=" in content:
            key, value = (part.strip() for part in content.split("=", 1))
            if _NUMBER.fullmatch(value):
                numbers[key.upper()] = _float(value)
            else:
                words[key.upper()] = value.strip("'\" ")
        else:
            parts = content.split()
            if not all(_NUMBER.fullmatch(part) for part in parts):
                raise ConfigurationError(
                    f"{path}:{line}: {content!r} is neither KEY = VALUE nor a row of numbers"
                )
            tables.setdefault(section, []).append(tuple(map(_float, parts)))
    for key, unit in _UNITS.items():
        if words.get(key, unit).lower() not in (unit, unit.removesuffix("s"), unit + "s"):
            raise ConfigurationError(f"{path}: [UNITS] {key} = {words[key]!r}; only {unit} is read")
    return TyreFile(path, numbers, words, {name: tuple(rows) for name, rows in tables.items()})


def _float(text: str) -> float:
    """A number that _NUMBER matches; Fortran programs write 3.4D+04."""
    return float(re.sub("[dD]", "e", text))


def lacking(file: TyreFile) -> dict[str, list[str]]:
    """What the file has and the plant's tyre has not, by group."""
    found = {
        group: [name for name in names.split() if file.numbers.get(name, 0.0) != 0.0]
        for group, names in GROUPS.items()
    }
    if file.words.get("FE_METHOD", "").upper() == "YES":
        found["friction_ellipse"] = ["FE_METHOD"]
    if file.tables.get("DEFLECTION_LOAD_CURVE"):
        found["load_curve"] = ["DEFLECTION_LOAD_CURVE"]
    found["scaling"] = [
        name for name, value in file.numbers.items() if _SCALE.fullmatch(name) and value != 1.0
    ]
    return {group: names for group, names in found.items() if names}


def tyre_values(file: TyreFile, leave_out: Sequence[str] = ()) -> dict[str, float]:
    """The keys of a machine's [tyre] table that the file gives.

    leave_out: groups to do without. Raises ConfigurationError for what is lacking and not left out.
    """
    known = [*GROUPS, *MACHINERY]
    for group in leave_out:
        if group not in known:
            raise ConfigurationError(f"tyre.leave_out: {group!r} is not one of {', '.join(known)}")
    if missing := {group: names for group, names in lacking(file).items() if group not in leave_out}:
        groups = "; ".join(f"{group} ({', '.join(names)})" for group, names in missing.items())
        raise ConfigurationError(
            f"{file.path}: the plant's tyre lacks {groups}; name the groups in tyre.leave_out to do without them"
        )
    radius, load = file.number("UNLOADED_RADIUS"), file.number("FNOMIN")
    values = {name.lower(): file.numbers.get(name, 0.0) for name in SAME}
    sign = -1.0 if file.number("PDY1") < 0.0 else 1.0
    values |= {
        "radius_m": radius,
        "nominal_load_N": load,
        "qfz1": file.number("VERTICAL_STIFFNESS") * radius / load,
        "qfz2": 0.0,
        "pfz1": file.numbers.get("PFZ1", 0.0),
        "damping_N_s_per_m": file.number("VERTICAL_DAMPING"),
        "pky1": abs(file.number("PKY1")),
        "pdy1": sign * file.number("PDY1"),
        "pdy2": sign * file.numbers.get("PDY2", 0.0),
    }
    if "NOMPRES" in file.numbers:
        values["nominal_pressure_bar"] = file.numbers["NOMPRES"] * 1e-5
    return values


def with_tir(table: CheckedTable, changes: Sequence[Change]) -> CheckedTable:
    """The [tyre] table with the values of the .tir file it names laid over it, or the table itself if it names none.

    changes: those laid over the machine's file, none of which may be about a value of the .tir file.
    """
    if "tir" not in table:
        return table
    path = Path(table.text("tir"))
    path = path if path.is_absolute() else Path(table.file.removesuffix(" with --set")).parent / path
    leave_out = table.values.get("leave_out", [])
    if not isinstance(leave_out, list) or not all(isinstance(group, str) for group in leave_out):
        raise table.error("leave_out", f"= {leave_out!r} is not a list of texts")
    given = tyre_values(read_tir(path), leave_out)
    for key, _ in changes:
        if key[0] == "tyre" and key[-1] in given:
            raise table.error(key[-1], f"comes from {path}; change it there")
    kept = {key: value for key, value in table.values.items() if key not in ("tir", "leave_out")}
    return CheckedTable({**kept, **given}, file=table.file, section="tyre")
