"""The command line: finds the chosen command, imports its module, and turns its errors into one line.

Exit codes: 0 passed, 1 failed, 2 misused, 3 a process of the bench died, 4 the bus was lost, 5 inconclusive,
130 interrupted. The commands stand in `loaderhil.commands`. Their modules are imported on use, so that the help page is
quick and a hub or a recorder does not load a plant.
"""

import importlib
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_group

from bus.user_error import UserError
from hil.ending import STORAGE, Ending, ending_of_error
from hil.shell.interruption import report_interruption
from loaderhil.commands import COMMANDS, PANELS

EPILOG = "Exit codes: 0 passed, 1 failed, 2 misused, 3 a process died, 4 bus lost, 5 inconclusive, 130 interrupted."


class CommandTable(TyperGroup):
    """The commands of the table. Each is a placeholder with name and summary until it is used."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for panel, commands in PANELS.items():
            for name, command in commands.items():
                self.add_command(TyperCommand(name, help=command.summary, rich_help_panel=panel))

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help page in plain text: loading what draws boxes takes as long as all the rest, and this page is asked for most."""
        self.rich_markup_mode = None
        super().format_help(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The commands under their titles, each with its summary."""
        # one width for all titles: write_dl aligns the summaries of a section only
        width = max(len(name) for commands in PANELS.values() for name in commands)
        for panel, commands in PANELS.items():
            with formatter.section(panel):
                formatter.write_dl(
                    [(name.ljust(width), command.summary) for name, command in commands.items()]
                )

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first word names, imported; also Typer's error with a suggestion for a wrong word."""
        # only the chosen command is imported: numpy, pandas or the plant would make every call slow
        name, command, rest = super().resolve_command(ctx, args)
        # None: a word that is no command while the shell completes; there is nothing to import
        return name, load_command(name) if name is not None else command, rest


def load_command(name: str) -> Any:
    """The command with its options, from the module that holds it."""
    app = typer.Typer(rich_markup_mode="markdown")
    importlib.import_module(COMMANDS[name].module).register(app)
    # a module may register several commands: `run` and `demo` share one
    return get_group(app).commands[name]


app = typer.Typer(
    name="loaderhil",
    cls=CommandTable,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    # an exception that is no UserError is a defect: the plain traceback belongs into the bug report
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=EPILOG,
    help="Hardware-in-the-loop CAN bench for articulated wheel loaders.",
)


def _version(wanted: bool) -> None:
    # asked of the installed package and not of a constant here, which would be a second place to raise the number
    if wanted:
        import importlib.metadata

        print(f"loaderhil {importlib.metadata.version('loaderhil')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Hardware-in-the-loop CAN bench for articulated wheel loaders."""


def main() -> None:
    """Entry point: every error of the user's input ends in one line, not in a traceback."""
    try:
        app()
    except KeyboardInterrupt:
        report_interruption()
        sys.exit(Ending.INTERRUPTED)
    # Typer turns Ctrl-C in a command into SystemExit: only the chain of causes still names it
    except SystemExit as ended:
        if ended.__context__ is not None and isinstance(ended.__context__.__cause__, KeyboardInterrupt):
            report_interruption()  # Typer ends an interrupted command without a message
        raise
    except UserError as error:
        print(f"loaderhil: {error}", file=sys.stderr)
        sys.exit(ending_of_error(error))
    except OSError as error:
        # no file of the user is concerned: a defect, which keeps its traceback
        if error.filename is None and error.errno not in STORAGE:
            raise
        # a full disk names no file: the message has to do without
        where = f"{error.filename}: " if error.filename is not None else ""
        print(f"loaderhil: {where}{error.strerror}", file=sys.stderr)
        sys.exit(Ending.FAILED)
