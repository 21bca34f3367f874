"""`loaderhil deploy`: the check before a deployed ECU sends, and the files with which systemd runs it."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from bus.user_error import UserError
from hil.ending import Ending

commands = typer.Typer(
    no_args_is_help=True,
    help="Run the ECU as a service of a Linux computer: `deploy new`, `deploy check`, `deploy units`.",
)
TEMPLATE = Path(__file__).parent / "ecu.toml"
SettingsArgument = Annotated[
    Path, typer.Argument(metavar="FILE", help="Settings of the deployed ECU (TOML), from `deploy new`.")
]


class FileThereError(UserError, ValueError):
    """The file to write is there already."""


@commands.command()
def new(
    out: Annotated[Path, typer.Argument(metavar="FILE", help="File to write.")],
) -> None:
    """Write a commented settings file to start from.

    Example: `loaderhil deploy new /etc/loaderhil/ecu.toml`
    """
    if out.exists():
        raise FileThereError(
            f"{out}: it is there already, perhaps edited; move it away, or choose another name"
        )
    _write(out, TEMPLATE.read_text(encoding="utf-8"))


@commands.command("check")
def check_command(file: SettingsArgument) -> None:
    """Check settings, calibration, interface and bus before the ECU sends; listens and sends nothing.

    Exit code 0: the ECU may start; 1: it must not; 2: the settings cannot be used. Example: `loaderhil deploy check ecu.toml`
    """
    from deploy.check import check
    from deploy.settings import ServiceSettings
    from hil.verdict import Result

    verdicts = check(ServiceSettings.from_file(file))
    for verdict in verdicts:
        print(f"{verdict.result.value:12} {verdict.question}: {verdict.reason}", flush=True)
    failed = any(verdict.result is Result.FAILED for verdict in verdicts)
    raise typer.Exit(Ending.FAILED if failed else Ending.PASSED)


@commands.command()
def units(
    file: SettingsArgument,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Root of the target: / on the ECU itself, a folder elsewhere."
        ),
    ],
    program: Annotated[
        Path | None,
        typer.Option(
            "--program", metavar="PATH", help="Path of `loaderhil` on the target; by default as here."
        ),
    ] = None,
    ecu_program: Annotated[
        Path | None,
        typer.Option(
            "--ecu-program",
            metavar="PATH",
            help="Path of an exported `loader-ecu` on the target: the ECU's service is then this program, which needs no Python.",
        ),
    ] = None,
) -> None:
    """Write the files for systemd: CAN interface, services with watchdog and sandbox, user.

    Example: `loaderhil deploy units ecu.toml --out /`
    """
    from deploy.settings import ServiceSettings
    from deploy.target import check_paths, check_program
    from deploy.units import SETTINGS, service_files

    settings = ServiceSettings.from_file(file)
    check_paths(settings, out)
    found = check_program(program or Path(shutil.which("loaderhil") or "/usr/bin/loaderhil"))
    exported = None if ecu_program is None else check_program(ecu_program, "--ecu-program")
    files = service_files(settings, found, ecu_program=exported)
    target = out / SETTINGS.lstrip("/")
    # --out / with /etc/loaderhil/ecu.toml itself: nothing to copy
    if target.absolute() != file.absolute():
        _write(target, file.read_text(encoding="utf-8"))
    for name, text in files.items():
        _write(out / name, text)
    print("then, on the target, as root:")
    for line in (
        "systemd-sysusers",
        "systemctl enable --now systemd-networkd",
        "systemctl daemon-reload",
        # the name that systemctl knows a service by
        *(f"systemctl enable --now {Path(name).stem}" for name in files if name.endswith(".service")),
    ):
        print(f"    {line}")


def _write(path: Path, text: str) -> None:
    """Write a file whole, with its folders, and name it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(f"written: {path}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.add_typer(commands, name="deploy")
