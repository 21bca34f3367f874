"""Results of an identification as files: values with intervals (JSON), a .tir file, and a machine with calibration for plant and ECU."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from diagnosis.apply.toml_text import Line, with_values
from ecu.calibration import CALIBRATIONS
from hil.companions import CALIBRATION, named
from identify.field.chain import FieldResult
from identify.field.fit import COMPLIANCE, PointProblem
from identify.machine_text import TyreValue, with_tyre
from identify.rig.chain import Prepared
from identify.tyre.advice import Open
from identify.tyre.estimate import Estimate
from identify.tyre.parameters import COMBINED, INDEX, Nominal
from identify.tyre.patch import nominal_stiffness
from identify.tyre.rig_problem import CARCASS_NAME
from identify.tyre.tir_file import tir_text
from plant.sheets.machine import load_machine

BAR = 1e5
KNOWN = 0.25  # standard deviation of the carcass' compliance over its value, up to which a field test determines it
FOR_PLANT = (
    "PCX1",
    "PDX1",
    "PDX2",
    "PEX1",
    "PEX2",
    "PEX3",
    "PEX4",
    "PKX1",
    "PKX2",
    "PKX3",
    "PPX1",
    "PPX2",
    "PPX3",
    "PPX4",
)


def interval_text(found: Estimate, name: str) -> str:
    """'identified, 95 % 7.1 to 7.9'."""
    i = found.interval(name)
    return f"identified, 95 % {i.lower:.4g} to {i.upper:.4g}"


def as_json(ready: Prepared, found: Estimate, opened: Sequence[Open], origin: str) -> str:
    """The text of identification.json, for programs."""
    intervals = {n: found.interval(n) for n in found.names}
    content = {
        "origin": origin,
        "parameters": {
            n: {"value": i.value, "sd": i.sd, "lower": i.lower, "upper": i.upper, "by": found.by(n)}
            for n, i in intervals.items()
        },
        "nominal": {
            "load_N": ready.log.nominal.load,
            "pressure_bar": ready.log.nominal.pressure / BAR,
            "radius_m": ready.log.nominal.radius,
        },
        "undetermined": {o.name: {"reason": o.reason, "step": o.step} for o in opened},
        "rejected": dict(ready.rejected),
        "unusable": list(ready.unusable),
        "warnings": list(ready.warnings),
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def tyre_file(ready: Prepared, found: Estimate, origin: str) -> str:
    """The text of the .tir file."""
    n, c = ready.log.nominal, ready.log.calibration
    names = [name for name in found.names if name in INDEX]
    values = {name: found.values[name] for name in names}
    return tir_text(
        values,
        n,
        vertical_stiffness=nominal_stiffness(c.q1, c.q2, n),
        notes={name: interval_text(found, name) for name in names},
        comments=(origin,),
    )


def rig_machine(ready: Prepared, found: Estimate, base: str, out: Path, origin: str) -> Mapping[Path, str]:
    """MACHINE.toml on the tyre of a rig, and the ECU's calibration beside it. Raises the plant's ConfigurationError for values that it refuses."""
    tyre = [
        (name.lower(), found.values.get(name, 0.0), interval_text(found, name))
        if name in found.names
        else (name.lower(), 0.0, "not determined: 0")
        for name in FOR_PLANT
    ]
    carcass = (
        (found.values[CARCASS_NAME], interval_text(found, CARCASS_NAME))
        if CARCASS_NAME in found.names
        else None
    )
    return _machine_files(found, tyre, carcass, ready.log.nominal, base, out, origin)


def field_machine(
    result: FieldResult, problem: PointProblem, found: Estimate, base: str, out: Path, origin: str
) -> Mapping[Path, str]:
    """The same for the tyre of a field test: what it does not determine keeps the values of the machine that it begins with."""
    tyre: list[TyreValue] = []
    for name in (*FOR_PLANT, *COMBINED):
        if name in found.names:
            tyre.append((name.lower(), found.values[name], interval_text(found, name)))
        elif name in problem.fixed:
            tyre.append((name.lower(), problem.fixed[name], "assumed: all slips were small"))
    i = found.interval(COMPLIANCE)
    carcass = (
        (1.0 / i.value, f"identified, 95 % {1.0 / i.upper:.4g} to {1.0 / i.lower:.4g}")
        if i.sd < KNOWN * i.value
        else None
    )
    return _machine_files(found, tyre, carcass, result.log.nominal, base, out, origin)


def _machine_files(
    found: Estimate,
    tyre: Sequence[TyreValue],
    carcass: tuple[float, str] | None,
    nominal: Nominal,
    base: str,
    out: Path,
    origin: str,
) -> Mapping[Path, str]:
    machine = load_machine(base)
    said = "of the log's description"
    lines = [*tyre]
    if carcass is not None:
        lines.append(("longitudinal_stiffness_N_per_m", *carcass))
    given = {
        "radius_m": nominal.radius,
        "nominal_load_N": nominal.load,
        "nominal_pressure_bar": nominal.pressure / BAR,
    }
    lines += [(key, value, said) for key, value in given.items()]
    calibration = (CALIBRATIONS / f"{machine.family}.toml").read_text(encoding="utf-8")
    ecu = [
        Line(("wheel",), "slip_stiffness", found.values["PKX1"], interval_text(found, "PKX1")),
        Line(("wheel",), "unloaded_radius_m", nominal.radius, said),
        Line(("wheel",), "nominal_load_kn", nominal.load / 1e3, said),
    ]
    if carcass is not None:
        length = found.values["PKX1"] * nominal.load / carcass[0]
        ecu.append(
            Line(
                ("wheel",),
                "longitudinal_relaxation_m",
                length,
                "slip stiffness over that of the carcass",
            )
        )
    head = f"# Tyre: {origin}\n"
    return {
        out: with_tyre(base, lines, origin),
        named(out, CALIBRATION): head + with_values(calibration, ecu),
    }
