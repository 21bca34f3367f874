"""What an FMU says of itself: its variables with types, units, bounds and start values, from modelDescription.xml."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from discrepancy.signals.units import BASE, Scaled, Unit, parse_scaled, parse_unit
from fmi.archive import FmuError, Unpacked

Version = Literal[2, 3]

NUMBERS: Final[Mapping[Version, tuple[str, ...]]] = {
    2: ("Real", "Integer", "Boolean", "Enumeration"),
    3: (
        "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
        "Boolean", "Enumeration",
    ),
}  # fmt: skip
"""Types of variables that are single numbers; texts, clocks and binaries are left alone."""

REAL: Final = ("Real", "Float64", "Float32")
PLAIN: Final = "1"
LONGEST_IDENTIFIER: Final = 240  # bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A variable that is one number. Its numbers are in the FMU's own unit."""

    name: str
    reference: int  # value reference
    type: str  # of NUMBERS
    causality: str
    variability: str
    initial: str  # exact: its start value can be set; '' where the standard knows none
    sentence: str  # description; may be empty
    unit: str  # as the FMU writes it; empty: a plain number
    si: str  # SI unit of the same quantity
    factor: float = 1.0  # SI value = factor * value + offset
    offset: float = 0.0
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    nominal: float | None = None

    def to_si(self, value: float) -> float:
        """A value of the FMU in SI."""
        return self.factor * value + self.offset

    def from_si(self, value: float) -> float:
        """A value in SI in the FMU's unit."""
        return (value - self.offset) / self.factor

    @property
    def settable(self) -> bool:
        """Whether its value at the start can be given: a parameter, an input, an exact initial state."""
        return self.variability != "constant" and (
            self.initial == "exact" or self.causality in ("parameter", "input")
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """An FMU for co-simulation, unpacked."""

    file: Path
    unpacked: Unpacked
    version: Version
    name: str
    sentence: str
    token: str  # guid or instantiation token
    identifier: str  # of the binary
    tool: str  # that made it; may be empty
    variables: Mapping[str, Variable]
    states: Sequence[str]  # continuous states, as far as they are variables
    unknown_states: int  # that no variable names
    step_s: float | None  # preferred communication step, or the FMU's own fixed one
    notes: Sequence[str]  # what was left out or guessed, a sentence each

    def named(self, causality: str) -> list[Variable]:
        """The variables of one causality, in the order of the FMU."""
        return [v for v in self.variables.values() if v.causality == causality]


def fmpy_or_refusal() -> Any:
    """The module fmpy, imported late because it loads a lot. Raises FmuError with the remedy if it is not installed."""
    try:
        import fmpy
    except ImportError as error:
        raise FmuError(f"FMUs need FMPy ({error.name} is missing): pip install 'loaderhil[fmi]'") from error
    return fmpy


def read_description(file: Path) -> Description:
    """Unpack and read an FMU. Raises FmuError in one line: no zip, no description, model exchange only, no binary for this computer."""
    if not file.is_file():
        raise FmuError(f"{file}: no such file")
    fmpy = fmpy_or_refusal()
    unpacked = Unpacked(file)
    try:
        # without the schema: tools break it in places that do not matter; `model describe` reports it
        read = fmpy.read_model_description(unpacked.folder, validate=False)
    # FMPy raises what its parts raise: lxml's errors, KeyError, bare Exception
    except Exception as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise FmuError(f"{file}: its modelDescription.xml cannot be read: {first}") from error
    version = _version(file, read.fmiVersion)
    if read.coSimulation is None:
        kinds = "model exchange" if read.modelExchange is not None else "scheduled execution"
        raise FmuError(
            f"{file}: is for {kinds} only and brings no solver; export it for co-simulation (FMI {version}.0)"
        )
    _check_binary(file, unpacked.folder, read.coSimulation.modelIdentifier, version, fmpy)
    variables, notes = _variables(read, version)
    states = [u.variable.derivative for u in read.derivatives if u.variable.derivative is not None]
    names = [s.name for s in states if getattr(s, "name", None) in variables]
    return Description(
        file=file,
        unpacked=unpacked,
        version=version,
        name=read.modelName or file.stem,
        sentence=read.description or f"the FMU {file.name}",
        token=read.guid or "",
        identifier=read.coSimulation.modelIdentifier,
        tool=read.generationTool or "",
        variables=variables,
        states=names,
        unknown_states=len(read.derivatives) - len(names),
        step_s=_step(read),
        notes=notes,
    )


def _version(file: Path, text: str | None) -> Version:
    if text == "2.0":
        return 2
    if text is not None and text.startswith("3."):
        return 3
    raise FmuError(f"{file}: is of FMI {text}; FMI 2.0 and 3.0 are read")


def _step(read: Any) -> float | None:
    """The FMU's own fixed step, else that of its default experiment [s]."""
    fixed = getattr(read.coSimulation, "fixedInternalStepSize", None)
    preferred = read.defaultExperiment.stepSize if read.defaultExperiment is not None else None
    step = _number(fixed) or _number(preferred)
    return step if step is not None and step > 0.0 else None


def _check_binary(file: Path, folder: Path, identifier: str | None, version: Version, fmpy: Any) -> None:
    if not identifier:
        raise FmuError(f"{file}: has no modelIdentifier, so no binary can be found")
    # with its ending, the name of a file has at most 255 bytes
    if Path(identifier).name != identifier or len(identifier.encode()) > LONGEST_IDENTIFIER:
        raise FmuError(f"{file}: its modelIdentifier is {identifier[:80]!r}, which is no name of a binary")
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    if (folder / "binaries" / platform / f"{identifier}{fmpy.sharedLibraryExtension}").is_file():
        return
    there = sorted(p.name for p in (folder / "binaries").glob("*") if p.is_dir())
    has = f"it has {', '.join(there)}" if there else "it has none at all"
    sources = any((folder / "sources").glob("*.c"))
    hint = f"; it has C sources: `fmpy compile {file}` builds one" if sources else ""
    raise FmuError(f"{file}: has no binary for this computer ({platform}/{identifier}); {has}{hint}")


def _variables(read: Any, version: Version) -> tuple[dict[str, Variable], list[str]]:
    units = {unit.name: unit.baseUnit for unit in read.unitDefinitions if unit.baseUnit is not None}
    found: dict[str, Variable] = {}
    notes: list[str] = []
    for v in read.modelVariables:
        if v.type not in NUMBERS[version] or v.causality == "independent":
            continue
        if v.alias is not None:  # of FMI 3: another name of a variable that is there already
            continue
        if v.shape:
            notes.append(f"{v.name} is an array of {'x'.join(map(str, v.shape))}; arrays are left alone")
            continue
        declared = v.declaredType
        unit = v.unit or (declared.unit if declared is not None else None) or ""
        scaled, note = _scaled(unit, units.get(unit))
        if note:
            notes.append(f"{v.name}: {note}")

        def of(attribute: str, v: Any = v, declared: Any = declared) -> float | None:
            own = getattr(v, attribute)
            return _number(own if own is not None else getattr(declared, attribute, None))

        lower, upper = of("min"), of("max")
        found[v.name] = Variable(
            name=v.name,
            reference=v.valueReference,
            type=v.type,
            causality=v.causality,
            variability=v.variability or "",
            initial=v.initial or "",
            sentence=" ".join((v.description or "").split()),
            unit=unit,
            si=_text(scaled.unit, unit),
            factor=scaled.factor,
            offset=scaled.offset,
            start=_number(v.start),
            lower=-math.inf if lower is None else lower,
            upper=math.inf if upper is None else upper,
            nominal=of("nominal"),
        )
    return found, notes


def _number(text: Any) -> float | None:
    """A number of the description, which FMPy leaves as text; None where there is none."""
    if text is None:
        return None
    if text in ("true", "false"):
        return float(text == "true")
    try:
        return float(text)
    except (TypeError, ValueError):
        return None


def _scaled(text: str, base: Any) -> tuple[Scaled, str]:
    """The SI unit of a variable, with factor and offset; and a note where it had to be taken as a plain number."""
    plain = Scaled(parse_unit(PLAIN), 1.0)
    if base is not None:
        if base.mol or base.cd:
            return (
                plain,
                f"its unit {text} has moles or candelas, which are unknown here; taken as a plain number",
            )
        exponents = dict.fromkeys(BASE, 0) | {name: getattr(base, name) for name in BASE}
        unit = parse_unit(PLAIN)
        for name, power in exponents.items():
            unit = unit * parse_unit(name) ** power
        return Scaled(unit, float(base.factor), float(base.offset)), ""
    if not text:
        return plain, ""
    try:
        return parse_scaled(text), ""
    except ValueError:
        return plain, f"its unit {text} is not defined in the FMU and unknown here; taken as a plain number"


def _text(unit: Unit, own: str) -> str:
    """The SI unit as the FMU writes it, where that is readable here and SI: 'N.m', not 'kg.m^2/s^2'."""
    try:
        scaled = parse_scaled(own)
        if scaled.unit == unit and scaled.factor == 1.0 and scaled.offset == 0.0 and parse_unit(own) == unit:
            return own
    except ValueError:
        pass
    return str(unit)
