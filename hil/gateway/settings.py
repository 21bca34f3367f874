"""Reads the gateway's TOML file: which node is on which side, and rules that override the DBC's routes.

unknown = "drop"              # identifiers that the DBC does not know: "drop" or "pass"
queue_frames = 4096           # frames that may wait for a bus that does not take them

[nodes]                       # by default those of loader.dbc
plant = ["Machine"]
ecu = ["EstimatorEcu"]

[[route]]                     # any number; `message` of the DBC, or `id` as candump writes it
message = "VehicleSpeed"
from = "plant"
pass = false
"""

import difflib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bus.frame import EXTENDED, EXTENDED_MASK, STANDARD_MASK
from bus.user_error import UserError
from configuration import ConfigurationError, read_toml
from dbc.database import Database
from hil.gateway.core import QUEUE_FRAMES
from hil.gateway.routes import NODES, SIDES, Routes, Rule, Side


class SettingsError(UserError, ValueError):
    """The gateway's file cannot be used; the message names file, key, value and what is permitted."""


class _Table(BaseModel):
    # strict: TOML has types, so "4096" in quotes or 1 for true is a mistake
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class RouteTable(_Table):
    """One [[route]]."""

    side_from: Annotated[Side, Field(alias="from")]
    passes: Annotated[bool, Field(alias="pass")]
    message: str | None = None
    id: str | None = None


class Settings(_Table):
    """The content of the file; `routes_of` makes the routes of it."""

    unknown: Literal["drop", "pass"] = "drop"
    queue_frames: Annotated[int, Field(ge=1, le=1_000_000)] = QUEUE_FRAMES
    nodes: dict[Side, list[str]] = Field(default_factory=lambda: {s: sorted(NODES[s]) for s in SIDES})
    route: list[RouteTable] = Field(default_factory=list)


def read_settings(file: Path) -> Settings:
    """The settings in `file`; SettingsError if it is missing, not TOML, or not valid."""
    try:
        content = read_toml(file)
    except ConfigurationError as error:
        raise SettingsError(str(error)) from error
    try:
        return Settings.model_validate(content)
    except ValidationError as error:
        # one error at a time: the following ones are often consequences of the first
        first = error.errors(include_url=False)[0]
        message = _plain(first["type"], first["msg"], first["input"])
        raise SettingsError(f"{file}: {_key(first['loc'])}: {message}") from None


def _key(path: tuple[int | str, ...]) -> str:
    """`route 2.pass` of ("route", 1, "pass"): tables of an array count from one."""
    words = [f" {part + 1}" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(words).removeprefix(".")


def _plain(kind: str, message: str, value: object) -> str:
    match kind:
        case "extra_forbidden":
            return "there is no such key"
        case "missing":
            return "is missing"
    return f"{message[0].lower()}{message[1:]}, got {value!r}"


def routes_of(settings: Settings, database: Database, source: str) -> Routes:
    """The routes that the settings ask for. source: what errors call their file."""
    known = {node for codec in database.by_name.values() for node in (*codec.senders, *codec.receivers)}
    nodes: dict[Side, frozenset[str]] = {side: frozenset(settings.nodes.get(side, ())) for side in SIDES}
    for side in SIDES:
        for node in sorted(nodes[side] - known):
            raise SettingsError(
                f"{source}: nodes.{side}: {database.source} has no node '{node}'; it has {', '.join(sorted(known))}"
            )
    if both := sorted(nodes["plant"] & nodes["ecu"]):
        raise SettingsError(f"{source}: nodes: '{both[0]}' is on both sides; a node is on one")
    rules = [_rule(table, database, f"{source}: route {n}") for n, table in enumerate(settings.route, 1)]
    seen: set[tuple[Side, int]] = set()
    for number, rule in enumerate(rules, 1):
        # two rules for one frame: the order of the file would decide silently
        if (key := (rule.side_from, rule.can_id)) in seen:
            raise SettingsError(f"{source}: route {number}: an earlier route already rules this frame")
        seen.add(key)
    return Routes(database, nodes=nodes, rules=rules, unknown_passes=settings.unknown == "pass")


def _rule(table: RouteTable, database: Database, where: str) -> Rule:
    if (table.message is None) == (table.id is None):
        raise SettingsError(f"{where}: give either message or id")
    if table.id is not None:
        return Rule(_can_id(table.id, where), table.side_from, table.passes)
    name = table.message or ""
    codec = database.by_name.get(name)
    if codec is None:
        near = difflib.get_close_matches(name, database.by_name, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise SettingsError(f"{where}: message: {database.source} has no message '{name}'{hint}")
    return Rule(codec.can_id, table.side_from, table.passes)


def _can_id(text: str, where: str) -> int:
    """Three hexadecimal digits are an 11-bit identifier, eight a 29-bit one."""
    try:
        value = int(text, 16)
    except ValueError:
        value = -1
    if len(text) == 3 and 0 <= value <= STANDARD_MASK:
        return value
    if len(text) == 8 and 0 <= value <= EXTENDED_MASK:
        return value | EXTENDED
    raise SettingsError(
        f"{where}: id: '{text}' is no identifier; write three hexadecimal digits (000 to 7FF) or eight "
        "(00000000 to 1FFFFFFF), as candump does"
    )
