"""Results of an identification as files: values with intervals (JSON), a .tir file, and a machine with calibration for plant and ECU."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from diagnosis.apply.toml_text import Line, with_values
from ecu.calibration import CALIBRATIONS
from hil.companions import CALIBRATION, named
from identify.rig.chain import Prepared
from identify.tyre.advice import Open
from identify.tyre.estimate import Estimate
from identify.tyre.parameters import INDEX
from identify.tyre.rig_problem import CARCASS_NAME
from identify.tyre.tir_file import tir_text
from plant.sheets.machine import MACHINES, load_machine

BAR = 1e5
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
            n: {"value": i.value, "sd": i.sd, "lower": i.lower, "upper": i.upper}
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
    # vertical stiffness: the slope dF/dz of the calibration's law (118) at nominal load
    n, c = ready.log.nominal, ready.log.calibration
    depth = (-c.q1 + (c.q1**2 + 4.0 * c.q2) ** 0.5) / (2.0 * c.q2) if c.q2 > 0.0 else 1.0 / c.q1
    stiffness = n.load / n.radius * (c.q1 + 2.0 * c.q2 * depth)
    names = [name for name in found.names if name in INDEX]
    values = {name: found.values[name] for name in names}
    return tir_text(
        values,
        n,
        vertical_stiffness=float(stiffness),
        notes={name: interval_text(found, name) for name in names},
        comments=(origin,),
    )


def machine_files(ready: Prepared, found: Estimate, base: str, out: Path, origin: str) -> Mapping[Path, str]:
    """MACHINE.toml on the identified tyre, and the ECU's calibration beside it. Raises the plant's ConfigurationError for values that it refuses."""
    machine = load_machine(base)
    n = ready.log.nominal
    text = (
        (MACHINES / f"{base}.toml").read_text(encoding="utf-8")
        if not base.endswith(".toml")
        else Path(base).read_text(encoding="utf-8")
    )
    lines = [
        Line(
            ("tyre",),
            name.lower(),
            found.values.get(name, 0.0),
            interval_text(found, name) if name in found.names else "not determined: 0",
        )
        for name in FOR_PLANT
    ]
    if CARCASS_NAME in found.names:
        lines.append(
            Line(
                ("tyre",),
                "longitudinal_stiffness_N_per_m",
                found.values[CARCASS_NAME],
                interval_text(found, CARCASS_NAME),
            )
        )
    given = {"radius_m": n.radius, "nominal_load_N": n.load, "nominal_pressure_bar": n.pressure / BAR}
    lines += [Line(("tyre",), key, value, "of the rig's log") for key, value in given.items()]
    calibration = (CALIBRATIONS / f"{machine.family}.toml").read_text(encoding="utf-8")
    ecu = [
        Line(("wheel",), "slip_stiffness", found.values["PKX1"], interval_text(found, "PKX1")),
        Line(("wheel",), "unloaded_radius_m", n.radius, "of the rig's log"),
        Line(("wheel",), "nominal_load_kn", n.load / 1e3, "of the rig's log"),
    ]
    if CARCASS_NAME in found.names:
        ecu.append(
            Line(
                ("wheel",),
                "longitudinal_relaxation_m",
                found.values["PKX1"] * n.load / found.values[CARCASS_NAME],
                "slip stiffness over that of the carcass",
            )
        )
    head = f"# Tyre: {origin}\n"
    return {
        out: head + with_values(text, lines),
        named(out, CALIBRATION): head + with_values(calibration, ecu),
    }
