"""Real FMUs for tests, compiled from slave.c and a few lines of C: a description, a binary, a zip archive."""

import shutil
import subprocess
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

from fmi.export import RUNTIME

HERE = Path(__file__).parent
TOKEN = "{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"
UNITS = {
    "m": 'm="1"', "m3/s": 'm="3" s="-1"', "m2": 'm="2"', "1/s": 's="-1"', "l/s": 'm="3" s="-1" factor="0.001"',
    "rad/s": 's="-1" rad="1"', "rad": 'rad="1"', "degC": 'K="1" offset="273.15"', "N.m": 'kg="1" m="2" s="-2"', "V": 'kg="1" m="2" s="-3" A="-1"',
    "m/s": 'm="1" s="-1"', "m/s2": 'm="1" s="-2"', "Pa": 'kg="1" m="-1" s="-2"',
}  # fmt: skip


@dataclass(frozen=True)
class Var:
    """One variable; its place in the list is its value reference."""

    name: str
    causality: str
    start: float | None = None
    unit: str = ""
    more: str = ""  # further attributes, such as min and max
    sentence: str = ""


@dataclass(frozen=True)
class Source:
    """A model in C: `v[NAME]` are its variables, in capitals."""

    name: str
    variables: Sequence[Var]
    advance: str  # one step of `h` from `t`; returns not 0 to fail
    outputs: str = ""
    step_s: float | None = None
    kind: str = "CoSimulation"


TANK = Source(
    "Tank",
    (
        Var("inflow", "input", 0.0, "m3/s", 'variability="discrete"'),
        Var("level", "output", None, "m"),
        Var("area", "parameter", 1.0, "m2", 'min="0.5" max="2"', "area of the tank"),
        Var("leak", "parameter", 0.0, "1/s", 'min="0" max="1" nominal="0.2"', "water is lost in proportion to the level"),
        Var("start_level", "parameter", 1.0, "m"),
        Var("now", "local", None, "m"),
    ),
    # the same midpoint rule as in docs/howto/write-a-model.md
    """
    double u = v[INFLOW] / v[AREA], middle = v[NOW] + 0.5 * h * (u - v[LEAK] * v[NOW]);
    if (!begun) { v[NOW] = v[START_LEVEL]; middle = v[NOW] + 0.5 * h * (u - v[LEAK] * v[NOW]); }
    v[NOW] += h * (u - v[LEAK] * middle);
    return 0;
    """,
    "v[LEVEL] = begun ? v[NOW] : v[START_LEVEL];",
    0.1,
)  # fmt: skip


def built(source: Source, folder: Path, fmi: int = 2, defines: Sequence[str] = ()) -> Path:
    """The FMU of a source in `folder`, of FMI 2 or 3."""
    file = folder / f"{source.name.lower()}.fmu"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(_compiled(source, fmi, tuple(defines)), file)
    return file


@lru_cache
def _compiled(source: Source, fmi: int, defines: tuple[str, ...]) -> Path:
    import fmpy

    work = Path(mkdtemp(prefix="fmu-of-tests-"))
    (work / "model.h").write_text(_model(source), encoding="utf-8")
    shutil.copy(HERE / "slave.c", work)
    library = work / f"{source.name}.so"
    headers = (Path(fmpy.__file__).parent / "c-code", RUNTIME.parent)
    flags = [
        "-shared",
        "-fPIC",
        "-O1",
        "-w",
        "-ffp-contract=off",
        f"-DFMI={fmi}",
        *(f"-D{d}" for d in defines),
    ]
    subprocess.run(
        ["gcc", *flags, *(f"-I{folder}" for folder in headers), "slave.c", "-o", library, "-lm"],
        cwd=work,
        check=True,
    )
    place = "linux64" if fmi == 2 else "x86_64-linux"
    with zipfile.ZipFile(work / "a.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description(source, fmi))
        archive.write(library, f"binaries/{place}/{source.name}.so")
    return work / "a.fmu"


def _model(source: Source) -> str:
    names = "".join(f"#define {v.name.upper()} {i}\n" for i, v in enumerate(source.variables))
    starts = ", ".join(str(v.start or 0.0) for v in source.variables)
    begun = len(source.variables)  # a number beyond the variables: whether a step has been done
    return f"""#include <math.h>
{names}#define COUNT {begun + 1}
#define START {{{starts}, 0}}
#define begun v[{begun}]
static void outputs(double *v) {{ {source.outputs} }}
static int once(double *v, double t, double h) {{ {source.advance} }}
static int advance(double *v, double t, double h) {{ int bad = once(v, t, h); begun = 1; return bad; }}
"""


def description(source: Source, fmi: int) -> str:
    """modelDescription.xml."""
    used = sorted({v.unit for v in source.variables if v.unit})
    units = "".join(f'<Unit name="{u}"><BaseUnit {UNITS[u]}/></Unit>' for u in used)
    return (_description2 if fmi == 2 else _description3)(
        source, f"<UnitDefinitions>{units}</UnitDefinitions>" if units else ""
    )


def _attributes(v: Var) -> tuple[str, str]:
    """Of the variable, and of its value."""
    more = v.more.split()
    outer = [m for m in more if m.startswith(("variability", "initial"))]
    if v.causality == "parameter":
        outer.append('variability="tunable"')
    inner = [m for m in more if m not in outer]
    if v.start is not None:
        inner.append(f'start="{v.start}"')
    if v.unit:
        inner.append(f'unit="{v.unit}"')
    return f'causality="{v.causality}" ' + " ".join(outer), " ".join(inner)


def _experiment(source: Source) -> str:
    return f'<DefaultExperiment stepSize="{source.step_s}"/>' if source.step_s else ""


def _description2(source: Source, units: str) -> str:
    variables, outputs, unknown = "", "", ""
    for i, v in enumerate(source.variables):
        outer, inner = _attributes(v)
        variables += f'<ScalarVariable name="{v.name}" valueReference="{i}" description="{v.sentence}" {outer}><Real {inner}/></ScalarVariable>'
        if v.causality == "output":
            outputs += f'<Unknown index="{i + 1}"/>'
            unknown += f'<Unknown index="{i + 1}"/>' if v.start is None else ""
    initial = f"<InitialUnknowns>{unknown}</InitialUnknowns>" if unknown else ""
    # FMI 2 has no initial unknowns without outputs
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{source.name}" guid="{TOKEN}">
<{source.kind} modelIdentifier="{source.name}"/>{units}{_experiment(source)}
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs>{outputs}</Outputs>{initial}</ModelStructure>
</fmiModelDescription>"""


def _description3(source: Source, units: str) -> str:
    variables, outputs, unknown = "", "", ""
    for i, v in enumerate(source.variables):
        outer, inner = _attributes(v)
        variables += (
            f'<Float64 name="{v.name}" valueReference="{i}" description="{v.sentence}" {outer} {inner}/>'
        )
        if v.causality == "output":
            outputs += f'<Output valueReference="{i}"/>'
            unknown += f'<InitialUnknown valueReference="{i}"/>' if v.start is None else ""
    time = len(source.variables)
    variables += (
        f'<Float64 name="time" valueReference="{time}" causality="independent" variability="continuous"/>'
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{source.name}" instantiationToken="{TOKEN}">
<{source.kind} modelIdentifier="{source.name}"/>{units}{_experiment(source)}
<ModelVariables>{variables}</ModelVariables>
<ModelStructure>{outputs}{unknown}</ModelStructure>
</fmiModelDescription>"""
