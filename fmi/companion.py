"""Reads the file beside an FMU, machine.toml beside machine.fmu: what the diagnosis cannot know from the FMU. All its numbers are in the
FMU's own units.

A table that is there says all of its kind: with [parameters], no other parameter is fitted. A table that is absent leaves the defaults.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

from configuration import CheckedTable
from discrepancy.model.sensors import KINDS
from fmi.description import REAL, Description, Variable

SENSOR_KINDS: Final = ("bias", "scale", "delay", "lag")
"""Faults of a sensor that are looked for unless the file says otherwise."""

MOST_DEFAULTS: Final = 12  # parameters that are fitted without being named; more are seldom all identifiable
KNOWN_TO: Final = 0.1  # prior of a parameter that nobody named, as a share of its start value
CHANGE: Final = 0.05  # typical change of a parameter, as a share of its start value

SHOWN: Final = 12  # names in an error

ABSENT: Final = "\0"  # no text of a file can be this


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """An input of the FMU as a channel."""

    variable: Variable
    column: str  # its name in recordings
    held: bool
    optional: bool  # may be missing in a recording; the FMU's start value then holds
    port: float | None  # typical size of what may be added to it; None: by its movement; 0: nothing is added
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """An output of the FMU as a channel with a sensor."""

    variable: Variable
    column: str
    kinds: tuple[str, ...]  # of its sensor's faults
    bias: float | None  # an offset that matters; None: a tenth of its movement
    delay_s: float | None
    noise: float | None
    disturbance: float | None
    floor: float | None
    lag_s: float | None  # low-pass that the FMU has in this output already


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A parameter or an initial state of the FMU as a parameter of the model."""

    variable: Variable
    value: float  # of the baseline; of an effect: off
    lower: float
    upper: float
    typical: float
    prior_sd: float | None = None
    initial: bool = False  # refitted in every window
    guess: str = ""  # output from whose first value the fit of an initial state starts
    shape: bool = False  # means nothing while the effect is off


@dataclass(frozen=True, slots=True, kw_only=True)
class Hidden:
    """An effect that the FMU can switch on by its parameters."""

    name: str
    sentence: str
    reverse: str
    equation: str
    kind: Literal["physics", "sensor"]
    place: str
    excited_by: str
    parameters: tuple[Fitted, ...]
    confusable: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Companion:
    """The file, or the defaults where there is none."""

    file: Path | None
    sentence: str
    inputs: Mapping[str, Input]
    outputs: Mapping[str, Output]
    parameters: Sequence[Fitted]
    effects: Sequence[Hidden]
    constants: Mapping[str, Variable]  # by name in the recording
    values: Mapping[str, tuple[Variable, float]]  # start values other than the FMU's
    settings: Mapping[str, float]  # fields of the Model of the same names, with step_s
    notes: Sequence[str]


SETTINGS: Final[Mapping[str, tuple[str, float]]] = {
    "step_s": ("s", 1e-6),
    "window_s": ("s", 1e-3),
    "lead_s": ("s", 0.0),
    "held_out_s": ("s", 1e-3),
    "bandwidth_hz": ("Hz", 1e-6),
    "jacobian_reach": ("1", 0.0),
    "negligible": ("1", 0.0),
    "least_explained": ("1", 0.0),
}
"""Keys of the file that are fields of the Model -> unit and least value."""


def read_companion(description: Description, file: Path | None) -> Companion:
    """The companion of an FMU; file: None reads none. Raises ConfigurationError, with the closest names for a variable that the FMU lacks."""
    top = CheckedTable({}, file="") if file is None else CheckedTable.from_file(file)
    top.table("plant")  # for the FMU as a plant, read elsewhere
    # infinite: not given. Asking for every key makes errors about unknown ones name the closest
    asked = {
        key: top.number(key, unit=unit, low=low, default=math.inf) for key, (unit, low) in SETTINGS.items()
    }
    settings = {key: value for key, value in asked.items() if value < math.inf}
    reader = _Reader(description, top)
    inputs, outputs = reader.inputs(), reader.outputs()
    effects = reader.effects()
    constants, values = reader.constants(), reader.values()
    initial = reader.initial()
    # what has a place already is no parameter to fit by default
    taken = {p.variable.name for e in effects or () for p in e.parameters} | {
        v.name for v in constants.values()
    }
    taken |= set(values) | {p.variable.name for p in initial}
    parameters, notes = reader.parameters(taken)
    if effects is None:
        effects = reader.default_effects({p.variable.name for p in parameters} | taken)
    sentence = top.text("sentence", default=description.sentence)
    top.finish()
    return Companion(
        file=file,
        sentence=sentence,
        inputs=inputs,
        outputs=outputs,
        parameters=(*parameters, *initial),
        effects=effects,
        constants=constants,
        values=values,
        settings=settings,
        notes=[*description.notes, *notes],
    )


class _Reader:
    """The tables of one file, against the variables of one FMU."""

    def __init__(self, description: Description, top: CheckedTable) -> None:
        self._of, self._top = description, top

    def inputs(self) -> dict[str, Input]:
        tables, found = self._top.table("inputs"), {}
        for variable in self._of.named("input"):
            table, name = tables.table(variable.name), variable.name
            numeric = variable.type in REAL
            found[name] = Input(
                variable=variable,
                column=table.text("column", default=name),
                held=table.flag("held", default=not numeric or variable.variability == "discrete"),
                optional=table.flag("optional", default=False),
                port=_maybe(table, "port", variable.unit) if numeric else 0.0,
                sentence=table.text("sentence", default=f"{name} beyond the recorded one"),
            )
            table.finish()
        tables.finish()
        return found

    def outputs(self) -> dict[str, Output]:
        tables, found = self._top.table("outputs"), {}
        for variable in self._of.named("output"):
            table, name = tables.table(variable.name), variable.name
            faults = (
                table.one_or_more("faults") if "faults" in table and table.values["faults"] else SENSOR_KINDS
            )
            if table.values.get("faults") == []:
                faults = table.texts("faults", count=0)
            if unknown := [kind for kind in faults if kind not in KINDS]:
                raise table.error("faults", f"has {unknown[0]!r}; known are {', '.join(KINDS)}")
            found[name] = Output(
                variable=variable,
                column=table.text("column", default=name),
                kinds=tuple(map(str, faults)) if variable.type in REAL else (),
                bias=_maybe(table, "bias", variable.unit),
                delay_s=_maybe(table, "delay_s", "s"),
                noise=_maybe(table, "noise", variable.unit),
                disturbance=_maybe(table, "disturbance", variable.unit),
                floor=_maybe(table, "floor", variable.unit),
                lag_s=_maybe(table, "lag_s", "s"),
            )
            table.finish()
        tables.finish()
        return found

    def parameters(self, taken: set[str]) -> tuple[list[Fitted], list[str]]:
        """The parameters to fit, and a note where none is fitted because there are too many."""
        if "parameters" in self._top:
            tables = self._top.table("parameters")
            return [self._fitted(tables, name) for name in tables.keys()], []  # noqa: SIM118
        usual = [v for v in self._candidates() if v.start and v.name not in taken]
        if len(usual) > MOST_DEFAULTS:
            note = f"{len(usual)} parameters could be fitted, so none is: name those to fit in [parameters]"
            return [], [note]
        return [
            Fitted(
                variable=v,
                value=v.start or 0.0,
                lower=v.lower,
                upper=v.upper,
                typical=CHANGE * abs(v.start or 0.0),
                prior_sd=KNOWN_TO * abs(v.start or 0.0),
            )
            for v in usual
        ], []

    def initial(self) -> list[Fitted]:
        """The initial states to fit; by default the outputs whose start values can be set."""
        if "initial" in self._top:
            tables = self._top.table("initial")
            return [self._fitted(tables, name, initial=True) for name in tables.keys()]  # noqa: SIM118
        return [
            Fitted(
                variable=v,
                value=v.start or 0.0,
                lower=v.lower,
                upper=v.upper,
                typical=_scale(v),
                initial=True,
                guess=v.name,
            )
            for v in self._of.named("output")
            if v.settable and v.type in REAL and v.variability == "continuous"
        ]

    def effects(self) -> list[Hidden] | None:
        """The effects of the file; None where it has no table of them."""
        if "effects" not in self._top:
            return None
        tables, found = self._top.table("effects"), []
        for name in tables.keys():  # noqa: SIM118
            table = tables.table(name)
            inner = table.table("parameters")
            one = None if "parameters" in table else table.text("parameter", default=name)
            if one is None:
                fitted = [self._fitted(inner, each) for each in inner.keys()]  # noqa: SIM118
            else:
                fitted = [self._read(table, "parameter", one, initial=False)]
            found.append(self._effect(table, name, fitted))
        return found

    def default_effects(self, taken: set[str]) -> list[Hidden]:
        """Parameters that start at 0 and have a scale: off unless a recording shows them."""
        return [
            Hidden(
                name=v.name,
                sentence=v.sentence or f"{v.name} is not 0",
                reverse="",
                equation=f"{v.name} ≠ 0",
                kind="physics",
                place=self._of.name,
                excited_by="",
                parameters=(Fitted(variable=v, value=0.0, lower=v.lower, upper=v.upper, typical=_scale(v)),),
            )
            for v in self._candidates()
            if v.start == 0.0
            and v.name not in taken
            and (v.nominal is not None or math.isfinite(v.upper - v.lower))
        ]

    def constants(self) -> dict[str, Variable]:
        table = self._top.table("constants")
        return {
            name: self._variable(table, name, table.text(name))
            for name in table.keys()  # noqa: SIM118
        }

    def values(self) -> dict[str, tuple[Variable, float]]:
        table = self._top.table("values")
        found = {}
        for name in table.keys():  # noqa: SIM118
            variable = self._variable(table, name, name)
            found[name] = variable, table.number(name, unit=variable.unit or "1")
        return found

    def _candidates(self) -> list[Variable]:
        return [
            v for v in self._of.named("parameter") if v.type in REAL and v.variability in ("fixed", "tunable")
        ]

    def _effect(self, table: CheckedTable, name: str, fitted: Sequence[Fitted]) -> Hidden:
        if not fitted:
            raise table.error("parameters", "is empty: an effect needs a parameter that switches it on")
        first = fitted[0].variable
        confusable = table.table("confusable")
        effect = Hidden(
            name=name,
            sentence=table.text(
                "sentence", default=first.sentence or f"{first.name} is not {fitted[0].value:g}"
            ),
            reverse=_text(table, "reverse"),
            equation=table.text("equation", default=f"{first.name} ≠ {fitted[0].value:g}"),
            kind="sensor" if table.text("kind", default="physics") == "sensor" else "physics",
            place=table.text("place", default=self._of.name),
            excited_by=_text(table, "excited_by"),
            confusable={other: confusable.text(other) for other in confusable.keys()},  # noqa: SIM118
            parameters=tuple(fitted),
        )
        if "kind" in table:
            table.choice("kind", ("physics", "sensor"))
        table.finish()
        return effect

    def _fitted(self, tables: CheckedTable, name: str, *, initial: bool = False) -> Fitted:
        table = tables.table(name)
        found = self._read(table, "", name, initial=initial, within=tables)
        table.finish()
        return found

    def _read(
        self,
        table: CheckedTable,
        key: str,
        name: str,
        *,
        initial: bool,
        within: CheckedTable | None = None,
    ) -> Fitted:
        """The parameter `name` with the numbers of a table; key: where the table names it."""
        variable = self._variable(within or table, key or name, name)
        unit = variable.unit or "1"
        value = table.number("value", unit=unit, default=variable.start or 0.0)
        guess = _text(table, "guess") if initial else ""
        outputs = [v.name for v in self._of.named("output")]
        if guess and guess not in outputs:
            raise table.error("guess", f"= {guess!r} is no output of the FMU; it has {', '.join(outputs)}")
        typical = table.number(
            "typical", unit=unit, default=CHANGE * abs(value) if value and not initial else _scale(variable)
        )
        if typical == 0.0:
            raise table.error("typical", "= 0: it is the smallest change that matters")
        lower = table.number("lower", unit=unit, default=variable.lower)
        upper = table.number("upper", unit=unit, default=variable.upper)
        if not lower <= value <= upper:
            raise table.error("value", f"= {value:g} {unit} is outside {lower:g}..{upper:g} {unit}")
        return Fitted(
            variable=variable,
            value=value,
            lower=lower,
            upper=upper,
            typical=typical,
            prior_sd=_maybe(table, "prior_sd", unit) if not initial else None,
            initial=initial,
            guess=guess,
            shape=table.flag("shape", default=False),
        )

    def _variable(self, table: CheckedTable, key: str, name: str) -> Variable:
        """The variable of that name, whose start value can be set."""
        known = self._of.variables
        if name not in known:
            settable = [v.name for v in known.values() if v.settable and v.causality != "input"]
            raise _lacking(table, key, name, settable, self._of)
        if not known[name].settable:
            raise table.error(
                key,
                f"is {name} of {self._of.file.name}, a {known[name].causality} whose start value cannot be set",
            )
        return known[name]


def closest(name: str, known: Sequence[str]) -> str:
    """The end of an error about a name that is not among the known ones: the most similar of them, else some of them."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    if near:
        return f"did you mean {' or '.join(map(repr, near))}?"
    return f"there are {', '.join(known[:SHOWN]) or 'none'}"


def _lacking(table: CheckedTable, key: str, name: str, known: Sequence[str], of: Description) -> Exception:
    return table.error(
        key,
        f"names {name!r}, which {of.file.name} has not as a parameter or initial state; {closest(name, known)}",
    )


def _maybe(table: CheckedTable, key: str, unit: str) -> float | None:
    """A number that is not negative; None where the key is absent."""
    value = table.number(key, unit=unit or "1", low=0.0, default=math.inf)
    return value if value < math.inf else None


def _text(table: CheckedTable, key: str) -> str:
    """A text, empty where the key is absent."""
    return table.text(key, default=ABSENT).removeprefix(ABSENT)


def _scale(variable: Variable) -> float:
    """A typical change of a variable of which nothing else is known, in its unit."""
    if variable.start:
        return 0.1 * abs(variable.start)
    if math.isfinite(variable.upper - variable.lower) and variable.upper > variable.lower:
        return 0.05 * (variable.upper - variable.lower)
    return 0.1 * abs(variable.nominal) if variable.nominal else 1.0
