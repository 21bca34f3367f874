"""`loaderhil conceal`: writes a recording with hidden effects and seals the truth beside it, for a blind test of the diagnosis."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagnosis.options import CompanionOption, ConstantOption, ModelOption, PartOption

if TYPE_CHECKING:
    from discrepancy.model.description import Model
    from discrepancy.signals.recording import Recording


def conceal(
    out: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder for recording.csv (for the loader: run) and truth.sealed."
        ),
    ],
    model: ModelOption,
    companion: CompanionOption = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME[=SIZE]",
            help="Hide this effect, of typical size if none is given; may be repeated.",
        ),
    ] = None,
    random: Annotated[
        int, typer.Option("--random", min=0, help="Hide this number of effects, chosen at random.")
    ] = 0,
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter", metavar="NAME=VALUE", help="True value of a baseline parameter; may be repeated."
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            "--noise",
            metavar="CHANNEL=SD",
            help="Standard deviation of the noise in the channel's unit; default: the model's sensor_noise, else 1 % of its spread.",
        ),
    ] = None,
    memory: Annotated[
        float,
        typer.Option(
            "--memory",
            min=0.0,
            max=0.999,
            help="Correlation of the noise from one sample to the next; 0 is white.",
        ),
    ] = 0.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="CHANNEL:KIND=SIZE",
            help="lost, damaged or spikes=SHARE; stuck or gap=START..END in seconds; may be repeated.",
        ),
    ] = None,
    like: Annotated[
        Path | None,
        typer.Option("--like", metavar="RECORDING", help="Take inputs and time stamps from this recording."),
    ] = None,
    manoeuvre: Annotated[
        str | None,
        typer.Option(
            "--manoeuvre",
            metavar="NAME",
            help="Take them from this manoeuvre of the model (default: its first); for the loader a scenario.",
        ),
    ] = None,
    constant: ConstantOption = None,
    part: PartOption = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of noise, faults and random choices.")
    ] = 0,
) -> None:
    """Write a recording with hidden effects, parameter errors, noise and faults, and seal the truth in a separate file.

    Example: `loaderhil conceal out/blind --model straight --random 1 --seed 7`, then
    `loaderhil diagnose out/blind/recording.csv --model straight --out out/blind`, then `loaderhil score out/blind`
    """
    import numpy as np

    from diagnosis.blind.hidden import Truth, concealed, drawn, faint, parsed_fault
    from diagnosis.blind.seal import seal
    from diagnosis.command import write
    from diagnosis.models import find_model
    from diagnosis.reading.csv_writer import csv_text
    from diagnosis.reading.reading import measured, numbers

    choice = find_model(model, companion)
    # The loader is not simulated by its model here: the bench runs it with driver, sensors, CAN coding and ECU,
    # so that the blind test does not use the simulation that the diagnosis fits.
    runs = choice.build_from is not None
    if runs:
        _refuse(like=like, constant=constant, part=part, parameter=parameter, noise=noise, fault=fault)
        built = choice.channels
    else:
        basis, initial = _basis(choice, like, manoeuvre, part, measured("--constant", constant or []))
        built = choice.build([basis])
    effects = _effects(built, effect or [])
    truth = Truth(
        model=built.name,
        seed=seed,
        # a stream of its own: the choice of effects stays the same when noise or faults change
        effects=effects | drawn(built, random, np.random.default_rng([seed, 1])),
        nuisances=numbers("--parameter", parameter or []),
        noise=numbers("--noise", noise or []),
        memory=memory,
        faults=[parsed_fault(built, text) for text in fault or []],
    )
    if runs:
        from diagnosis.blind.hidden_run import SCENARIO, concealed_run
        from hil.compose import Choice as Run

        file = out / "run"
        concealed_run(Run(scenario=manoeuvre or SCENARIO), truth, file)
    else:
        [file] = write("DIR", out, {"recording.csv": csv_text(concealed(built, basis, truth, initial))})
    [sealed] = write("DIR", out, {"truth.sealed": seal(truth, [file])})
    print(f"written: {file}\nwritten: {sealed}")
    # only effects named by the user: a note on a random one would give it away
    for line in faint(built, effects):
        print(line)


def _effects(model: "Model", texts: Sequence[str]) -> dict[str, dict[str, float]]:
    """Parameters by effect, from the texts of --effect. Raises NotHidden."""
    from diagnosis.blind.hidden import NotHidden, chosen

    found = {}
    for text in texts:
        name, _, sizes = (part.strip() for part in text.partition("="))
        if name in found:
            raise NotHidden(f"--effect '{text}': {name} is given twice")
        try:
            found[name] = chosen(model, name, [_size(s) for s in sizes.split(",")] if sizes else [])
        except ValueError as error:
            raise NotHidden(f"--effect '{text}': {error}") from error
    return found


def _size(text: str) -> float:
    """The number that a text gives. Raises NotHidden."""
    from diagnosis.blind.hidden import NotHidden

    try:
        return float(text)
    except ValueError:
        raise NotHidden(f"'{text.strip()}' is not a number") from None


def _refuse(**options: object) -> None:
    """Reject options that a run of the bench cannot use. Raises NotHidden."""
    from diagnosis.blind.hidden import NotHidden

    if given := [name for name, value in options.items() if value]:
        raise NotHidden(
            f"--{given[0]}: not available for the loader, whose runs come from the bench with its sensors, driver and noise; "
            "use --manoeuvre SCENARIO, --effect, --random and --seed"
        )


def _basis(
    choice: "Choice",
    like: Path | None,
    manoeuvre: str | None,
    part: str | None,
    given: dict[str, tuple[float, str | None]],
) -> "tuple[Recording, dict[str, float]]":
    """A recording with inputs and time stamps, and the initial states by name where a manoeuvre gives them."""
    from diagnosis.blind.hidden import NotHidden, staged
    from diagnosis.reading.reading import ReadOptions, constants_of, read_all

    channels = choice.channels
    if like is not None:
        read = read_all(choice, ReadOptions(paths=[like], part=part, constants=given), lambda _: None)
        if not read.recordings:
            raise NotHidden(f"--like {like}: {read.complaints[0].text}")
        return read.recordings[0], {}  # states are not recorded: the model's own defaults
    named = {m.name: m for m in channels.manoeuvres}
    if not named:
        raise NotHidden(
            f"{channels.name} has no manoeuvres; give --like RECORDING for inputs and time stamps"
        )
    if manoeuvre is not None and manoeuvre not in named:
        raise NotHidden(f"--manoeuvre '{manoeuvre}': {channels.name} has {', '.join(named)}")
    constants = constants_of(channels, given)
    _check_constants(channels, constants)
    used = named[manoeuvre] if manoeuvre is not None else channels.manoeuvres[0]
    return staged(channels, used, constants), dict(used.initial)


def _check_constants(model: "Model", constants: dict[str, float]) -> None:
    """Raises NotHidden where a constant of the model is missing."""
    from diagnosis.blind.hidden import NotHidden

    if gone := [f"'{name} [{unit}]=...'" for name, unit in model.constants.items() if name not in constants]:
        raise NotHidden(f"{model.name} needs --constant {' --constant '.join(gone)}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(conceal)


if TYPE_CHECKING:
    from diagnosis.models import Choice
