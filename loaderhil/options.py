"""Options that several commands of the bench share, so that each has one help text."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ecu.core import Core, Form

DEFAULT_BUS = "hub:/tmp/loaderhil.hub"  # a Unix socket; every user can name another

SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the scenario file; with the prefix `machine.` or `equipment.`, a value of those files. Repeatable.",
    ),
]
BusOption = Annotated[
    str,
    typer.Option(
        "--bus", metavar="ADDRESS", help="Address of the bus: hub:PATH, socketcan:INTERFACE or virtual:NAME."
    ),
]
PayloadOption = Annotated[
    float | None,
    typer.Option(
        "--payload-kg", min=0, max=20_000, help="Payload in the bucket in kg; by default the scenario's."
    ),
]
SeedOption = Annotated[
    int | None,
    # 32 bits: what numpy's and Python's generators both take, and run.json keeps exactly
    typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of the sensor noise; by default the scenario's."),
]
FormOption = Annotated[
    str,
    typer.Option(
        "--form",
        metavar="FORM",
        help="Equations of the estimators: `corrected`, or `printed` as in the thesis.",
    ),
]
ForeignEcuOption = Annotated[
    str | None,
    typer.Option(
        "--ecu",
        metavar="BUS",
        help="Bus of an external ECU that replaces the virtual one (hub:PATH, socketcan:INTERFACE); in real time.",
    ),
]
ForeignPlantOption = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="BUS|FILE.fmu",
        help="Bus of an external machine that replaces the simulated one, in real time; or an FMU that moves in its place, in lockstep or real time.",
    ),
]
WaitOption = Annotated[
    float,
    typer.Option("--wait-s", min=0.0, help="With --ecu or --plant: longest wait for its first frame [s]."),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the results as one JSON object, and nothing else.")
]
JunitOption = Annotated[
    Path | None,
    typer.Option("--junit", metavar="FILE", help="Also write the results as JUnit XML, for a build server."),
]
LimitsOption = Annotated[
    bool,
    typer.Option(
        "--limits/--no-limits", help="Whether the ECU limits speed and articulation rate, or only warns."
    ),
]

DetectOption = Annotated[
    bool,
    typer.Option(
        "--detect-faults/--no-detect-faults",
        help="Whether the ECU tests its sensors against each other, and goes on without a faulty one.",
    ),
]


EcuCoreOption = Annotated[
    str,
    typer.Option(
        "--ecu-core",
        metavar="CORE",
        help="What computes the virtual ECU: `python`; `c`, the exported C built with this computer's compiler, which sends the same frames in a third of the time; `auto`, in lockstep `c` where `loaderhil compile` has built it, else `python`. `run` in lockstep also takes `both`, compared at every cycle.",
    ),
]


class CoreError(typer.BadParameter):
    """The core does not exist; the message lists those that do."""


class FormError(typer.BadParameter):
    """The estimator form does not exist; the message lists those that do."""


def checked_form(form: str) -> "Form":
    """The form of that name. Raises FormError."""
    from hil.ecu_side import FORMS  # loads the ECU, which hub and plant do not need

    # looked up and not cast: the caller gets the literal type that `hil.ecu_side` asks for
    for known in FORMS:
        if known == form:
            return known
    raise FormError(f"{form!r} is not one of {', '.join(FORMS)}", param_hint="--form")


def checked_core(
    name: str, option: str = "--ecu-core", *, both: bool = False, lockstep: bool = True
) -> "Core":
    """The ECU's core of that name. Raises CoreError. both: whether two that are compared will do; lockstep: whether it is for a run in lockstep."""
    if name == "python" or (name == "auto" and not lockstep):
        from ecu.core import PYTHON

        return PYTHON
    # the translation to C is loaded for those who ask for it
    from deploy.c.both import BOTH
    from deploy.c.core import AUTO, BY_NAME

    known: dict[str, Core] = {**BY_NAME, AUTO.name: AUTO, **({BOTH.name: BOTH} if both else {})}
    if name not in known:
        raise CoreError(f"{name!r} is not one of {', '.join(known)}", param_hint=option)
    return known[name]
