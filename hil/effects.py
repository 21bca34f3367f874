"""`loaderhil effects`: what the plant can do beyond its machine file."""

import difflib
from typing import Annotated

import typer

from plant.checked import ConfigurationError


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(effects)


def effects(
    name: Annotated[str | None, typer.Argument(help="Show this one in full.")] = None,
    felt_in: Annotated[
        str | None,
        typer.Option("--felt-in", metavar="TEXT", help="Only those felt in this, such as: pressure."),
    ] = None,
) -> None:
    """List the physics that machine files leave out, or show one.

    Examples: `loaderhil effects --felt-in "joint torque"`, `loaderhil effects rolling_resistance`.
    """
    from plant.effects import effects as library

    known = library()
    if name is not None and name not in known:
        near = difflib.get_close_matches(name, known, n=3)
        hint = f"did you mean {', '.join(near)}?" if near else "`loaderhil effects` lists them"
        raise ConfigurationError(f"no effect named {name!r}; {hint}")
    if name is not None:
        _show(name)
        return
    found = {key: item for key, item in known.items() if felt_in is None or felt_in.lower() in item.acts_on}
    if not found:
        raise ConfigurationError(f"no effect is felt in {felt_in!r}")
    width = max(map(len, found))
    for key, item in found.items():
        print(f"{key:<{width}}  {item.sentence}")


def _show(name: str) -> None:
    from plant.effects import effect
    from plant.effects.handbook import toml

    item = effect(name)
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
