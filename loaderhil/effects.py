"""`loaderhil effects`: lists the plant's optional effects; `loaderhil effects add`: makes a new one from a diagnosis."""

import difflib
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from configuration import ConfigurationError

LISTING = "list"


class _ListUnlessAsked(TyperGroup):
    """A group whose first word may be the name of an effect; then, and without any word, the listing is used."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        # `loaderhil effects NAME` is shorter to type than `effects list NAME`
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = [LISTING, *args]
        return super().parse_args(ctx, args)


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(
        cls=_ListUnlessAsked,
        help="List the physics that machine files leave out (`effects`, `effects NAME`), or add what a diagnosis found.",
    )
    # a word like the others to Typer, so that its help shows the options of the listing
    group.command(LISTING)(effects)
    group.command("add")(add)
    app.add_typer(group, name="effects")


def add(
    findings: Annotated[
        Path,
        typer.Argument(
            metavar="FINDINGS.json", help="findings.json, or the folder that `diagnose --out` wrote."
        ),
    ],
    name: Annotated[str, typer.Option("--name", metavar="NAME", help="Name of the new effect.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.py", help="The file to write.")],
    model: Annotated[
        str | None,
        typer.Option(
            "--model", metavar="NAME|FILE.py", help="The diagnosed model, where it is not one of loaderhil's."
        ),
    ] = None,
) -> None:
    """Make an effect from the equation that a diagnosis found outside the library.

    Example: `loaderhil effects add out/diagnosis --name "pump leak" --out leaky.py --model tank.py`, then
    `loaderhil diagnose drive.csv --model leaky.py`
    """
    from diagnosis.apply.effect_file import written
    from diagnosis.command import print_written, write

    text, summary = written(findings, name, model, out)
    print_written(write("--out", out.parent, {out.name: text}))
    print(summary)


def effects(
    name: Annotated[str | None, typer.Argument(help="Effect to show in full.")] = None,
    felt_in: Annotated[
        str | None,
        typer.Option("--felt-in", metavar="TEXT", help="Only effects on this quantity, such as: pressure."),
    ] = None,
) -> None:
    """List the physics that machine files leave out, or show one.

    Examples: `loaderhil effects --felt-in "joint torque"`, `loaderhil effects rolling_resistance`.
    """
    # imported here: loads numba, which `--help` does not need
    from plant.effects import effects as library

    known = library()
    if name is not None and name not in known:
        # three: names of effects differ by a word, and the one that is meant need not be the nearest
        near = difflib.get_close_matches(name, known, n=3)
        hint = f"did you mean {', '.join(near)}?" if near else "`loaderhil effects` lists them"
        raise ConfigurationError(f"no effect named {name!r}; {hint}")
    if name is not None:
        _show(name)
        return
    # part of a phrase: a user looks for `pressure`, the library says `lift cylinder pressure`
    found = {key: item for key, item in known.items() if felt_in is None or felt_in.lower() in item.acts_on}
    if not found:
        raise ConfigurationError(f"no effect acts on {felt_in!r}")
    width = max(map(len, found))
    for key, item in found.items():
        print(f"{key:<{width}}  {item.sentence}")


def _show(name: str) -> None:
    from plant.effects import find_effect
    from plant.effects.handbook import toml

    item = find_effect(name)
    print(f"{item.name}: {item.sentence}\n")
    print(f"    {item.equation}\n")
    rows = [
        ("felt in", item.acts_on),
        ("signature", item.signature),
        ("shown by", item.excited_by),
        *(("looks like", f"{other.name}: {other.separate}") for other in item.confusable),
        ("source", item.source),
    ]
    for head, text in rows:
        print(f"{head:<11}{text}")
    print("\nIn a machine file:\n")
    print("\n".join(f"    {line}" for line in toml(item)))
