"""Writes our plant as an FMU for co-simulation. Its binary starts a Python with loaderhil, which the importing computer needs."""

import json
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Iterator, Mapping
from importlib.metadata import version as installed
from pathlib import Path
from typing import Final
from xml.sax.saxutils import quoteattr

from fmi.archive import DESCRIPTION, FmuError
from fmi.description import Version, fmpy_or_refusal
from fmi.quantities import COMMANDS, TRUTH
from fmi.slave import MACHINE, OUTPUTS, PARAMETERS
from plant.sheets.machine import MACHINES, load_machine
from plant.unit.scenario import Scenario

IDENTIFIER: Final = "loaderhil_plant"
STEP_S: Final = 0.01  # any whole number of milliseconds is accepted
RUNTIME: Final = Path(__file__).parent / "runtime" / "slave.c"
TOKENS: Final = uuid.UUID("9d9c4a6e-3b0f-5d57-8f0f-7a3cf8ad2e11")
OPTIONS: Final = ("-shared", "-fPIC", "-O2", "-std=gnu11", "-fvisibility=default")

UNITS: Final = {
    "N.m": 'kg="1" m="2" s="-2"', "rad/s": 's="-1" rad="1"', "rad": 'rad="1"', "m": 'm="1"', "m/s": 'm="1" s="-1"',
    "m/s2": 'm="1" s="-2"', "N": 'kg="1" m="1" s="-2"', "Pa": 'kg="1" m="-1" s="-2"', "kg": 'kg="1"', "1": "",
}  # fmt: skip


def export(machine: str, file: Path, fmi: Version, starts: Mapping[str, float]) -> None:
    """Write the FMU of a machine, a name or a file; starts: of parameters, where they differ from PARAMETERS. Raises FmuError without FMPy (its headers) or a C compiler."""
    headers = Path(fmpy_or_refusal().__file__).parent / "c-code"
    sheet = Path(machine) if machine.endswith(".toml") else MACHINES / f"{machine}.toml"
    load_machine(sheet if machine.endswith(".toml") else machine)  # a mistake is reported now
    text = description(machine, fmi, starts)
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        (folder / "start.h").write_text(_start(starts), encoding="utf-8")
        words = [
            "cc",
            *OPTIONS,
            f"-DFMI={fmi}",
            f"-I{headers}",
            f"-I{folder}",
            str(RUNTIME),
            "-o",
            "slave.so",
        ]
        try:
            subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
        except FileNotFoundError as error:
            raise FmuError("export-fmu needs a C compiler: install gcc or clang") from error
        except subprocess.CalledProcessError as error:
            raise FmuError(f"export-fmu: the compiler fails: {error.stderr.splitlines()[0]}") from error
        binary = (folder / "slave.so").read_bytes()
    place = "linux64" if fmi == 2 else "x86_64-linux"
    part = file.with_name(f".{file.name}.part")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(DESCRIPTION, text)
            archive.writestr(f"binaries/{place}/{IDENTIFIER}.so", binary)
            archive.writestr(f"resources/{MACHINE}", sheet.read_text(encoding="utf-8"))
        part.replace(file)
    except OSError as error:
        raise FmuError(f"{file}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def starts_of(scenario: Scenario) -> dict[str, float]:
    """Start values of the parameters that are those of a scenario. Raises FmuError for what the FMU has no parameter for."""
    start = scenario.start
    if scenario.changes.machine or (start.lift_arm_angle, start.tilt_angle) != (None, None):
        raise FmuError(
            f"--scenario {scenario.name}: changes the machine or starts with another pose of the bucket, for which the FMU has no parameter"
        )
    return {
        "start_payload_mass": scenario.payload_mass,
        "friction": scenario.surface.friction,
        "grade": scenario.surface.grade,
        "bank": scenario.surface.bank,
        "start_speed": start.speed,
        "start_articulation_angle": start.articulation_angle,
        "start_heading": start.heading,
    }


def _start(starts: Mapping[str, float]) -> str:
    """What the binary must know: numbers of variables, their start values, and this Python."""
    values = [float(starts.get(n, s)) for n, (_, s, _) in PARAMETERS.items()] + [0.0] * len(COMMANDS)
    return (
        f"#define PARAMETERS {len(PARAMETERS)}\n#define INPUTS {len(COMMANDS)}\n#define OUTPUTS {len(OUTPUTS)}\n"
        f"#define START {{{', '.join(map(repr, values))}}}\n#define PYTHON {json.dumps(sys.executable)}\n"
    )


def _variables(starts: Mapping[str, float]) -> Iterator[tuple[str, str, str, str]]:
    """Name, attributes of the variable, attributes of its number, description; in the order of the value references."""
    for name, (unit, start, sentence) in PARAMETERS.items():
        yield (
            name,
            'causality="parameter" variability="fixed"',
            f'unit="{unit}" start="{float(starts.get(name, start))!r}"',
            sentence,
        )
    for name, unit in COMMANDS.items():
        yield name, 'causality="input"', f'unit="{unit}" start="0"', "command to the actuators"
    for name in OUTPUTS:
        yield name, 'causality="output"', f'unit="{TRUTH[name]}"', "true value"


def description(machine: str, fmi: Version, starts: Mapping[str, float]) -> str:
    """modelDescription.xml. Its token follows from machine and versions, so that equal exports are equal."""
    token = uuid.uuid5(TOKENS, f"{machine} {fmi} {sorted(starts.items())} {installed('loaderhil')}")
    units = "".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in UNITS.items())
    variables, outputs, unknown = "", "", ""
    for reference, (name, outer, inner, sentence) in enumerate(_variables(starts)):
        head = f'name="{name}" valueReference="{reference}" description="{sentence}" {outer}'
        if fmi == 2:
            variables += f"<ScalarVariable {head}><Real {inner}/></ScalarVariable>\n"
            entry = f'<Unknown index="{reference + 1}"/>'
        else:
            variables += f"<Float64 {head} {inner}/>\n"
            entry = f'valueReference="{reference}"/>'
        if "output" in outer:
            outputs += entry if fmi == 2 else f"<Output {entry}"
            unknown += entry if fmi == 2 else f"<InitialUnknown {entry}"
    about = quoteattr(f"articulated wheel loader {machine}: from commands to its actuators to its motion")
    shared = f'description={about} generationTool="loaderhil {installed("loaderhil")}" variableNamingConvention="flat"'
    slave = f'<CoSimulation modelIdentifier="{IDENTIFIER}" needsExecutionTool="true" canHandleVariableCommunicationStepSize="true"/>'
    body = f'{slave}\n<UnitDefinitions>{units}</UnitDefinitions>\n<DefaultExperiment stepSize="{STEP_S}"/>\n'
    if fmi == 2:
        head = f'fmiVersion="2.0" modelName="WheelLoader" guid="{{{token}}}" {shared}'
        structure = f"<Outputs>{outputs}</Outputs><InitialUnknowns>{unknown}</InitialUnknowns>"
    else:
        head = f'fmiVersion="3.0" modelName="WheelLoader" instantiationToken="{{{token}}}" {shared}'
        structure = outputs + unknown
        count = len(PARAMETERS) + len(COMMANDS) + len(OUTPUTS)
        variables += f'<Float64 name="time" valueReference="{count}" causality="independent" variability="continuous" unit="s"/>'
        body = body.replace("</UnitDefinitions>", '<Unit name="s"><BaseUnit s="1"/></Unit></UnitDefinitions>')
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription {head}>\n{body}'
        f"<ModelVariables>\n{variables}</ModelVariables>\n<ModelStructure>{structure}</ModelStructure>\n</fmiModelDescription>\n"
    )
