"""Reads the text of a DBC file with cantools into plain data, for `dbc.database`."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bus.bounded_json import printable
from bus.frame import EXTENDED
from dbc.conduct import SEND_OPTIONAL, UNCERTAINTY_OF, LossConduct, NodeConduct
from dbc.definitions.definition import Definition, MessageDefinition
from dbc.definitions.limits import check_name, check_text
from dbc.errors import DatabaseError
from dbc.lean import without_mf4
from dbc.protections import Profile1
from dbc.signal import Signal

_MS = 1_000_000


def parse(path: str | Path, text: bytes, *, strict: bool) -> Definition:
    """The definition of a file with this content; DatabaseError, which names the file, where it is none."""
    check_text(Path(path), text)
    read = _read(path, text, strict=strict)
    try:
        nodes = {
            node.name: NodeConduct.of(node.name, _attributes(node, NodeConduct.ATTRIBUTES))
            for node in read.nodes
        }
        return Definition(tuple(message_of(message) for message in read.messages), nodes)
    except (ValueError, OverflowError, TypeError) as error:
        raise DatabaseError(f"{path}: {error}") from error


def _read(path: str | Path, text: bytes, *, strict: bool) -> Any:
    """The database of cantools."""
    with without_mf4():
        import cantools.database  # takes 0.1 s and 10 MiB with python-can; a DBC that is kept does not pay
        import cantools.errors

    # encoding and treatment of what is not in it as cantools opens a DBC
    file = io.TextIOWrapper(io.BytesIO(text), encoding="cp1252", errors="replace")
    try:
        return cantools.database.load(file, database_format="dbc", strict=strict)
    except (cantools.errors.Error, UnicodeDecodeError, ValueError) as error:
        raise DatabaseError(f"{path}: not a usable DBC: {_one_line(error)}") from error
    # the parser fails on damaged files in many ways (KeyError, TypeError, ...): all of them are the file's fault
    except Exception as error:
        raise DatabaseError(
            f"{path}: not a usable DBC: {type(error).__name__}: {_one_line(error)}"
        ) from error


def message_of(message: Any) -> MessageDefinition:
    """The same message out of a cantools database. ValueError for one that cannot be used."""
    check_name("message", message.name)
    for node in message.senders:
        check_name("node", node)
    return MessageDefinition(
        name=message.name,
        can_id=message.frame_id | (EXTENDED if message.is_extended_frame else 0),
        length=message.length,
        is_fd=bool(message.is_fd) or message.length > 8,
        is_j1939=message.is_extended_frame and _attribute(message, "VFrameFormat") == "J1939PG",
        cycle_ns=(message.cycle_time or 0) * _MS,
        send_type=_attribute(message, "GenMsgSendType") or "cyclic",
        is_optional=_attribute(message, SEND_OPTIONAL) == 1,
        comment=message.comment or "",
        senders=tuple(message.senders),
        receivers=tuple(sorted(message.receivers)),
        layout=tuple(signal_of(signal) for signal in message.signals),
        profile=_profile(message),
        conduct=LossConduct.of(message.name, _attributes(message, LossConduct.ATTRIBUTES)),
    )


def signal_of(signal: Any) -> Signal:
    """The same signal out of a cantools database. ValueError for one that cannot be used."""
    check_name("signal", signal.name)
    conversion = signal.conversion
    scale, offset = _integers_if_whole(conversion)
    return Signal(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        big_endian=signal.byte_order == "big_endian",
        signed=signal.is_signed,
        is_float=conversion.is_float,
        scale=scale,
        offset=offset,
        minimum=signal.minimum,
        maximum=signal.maximum,
        start_value=signal.raw_initial,
        unit=printable(signal.unit or ""),
        comment=signal.comment or "",
        receivers=tuple(signal.receivers),
        choices={int(value): printable(str(name)) for value, name in (signal.choices or {}).items()},
        is_multiplexer=signal.is_multiplexer,
        multiplexer=signal.multiplexer_signal,
        multiplexer_ids=frozenset(signal.multiplexer_ids or ()),
        uncertainty_of=_uncertainty_of(signal),
    )


def _one_line(error: Exception) -> str:
    """The message of a foreign error without line ends and control characters; it quotes the file."""
    return printable(" ".join(str(error).split()), 300)


def _attribute(message: Any, name: str) -> Any:
    """A DBC attribute of the message, or the file's default; ENUM values as their text."""
    if message.dbc is None:
        return None
    own, definitions = message.dbc.attributes, message.dbc.attribute_definitions
    definition = own[name].definition if name in own else definitions.get(name)
    if definition is None:
        return None
    value = own[name].value if name in own else definition.default_value
    # cantools gives an ENUM's value as an index or as its text, depending on where the file sets it
    is_index = definition.type_name == "ENUM" and isinstance(value, int)
    return definition.choices[value] if is_index else value


def _attributes(of: Any, names: Iterable[str]) -> dict[str, Any]:
    """The attributes of these names that a message or a node has, or that the file has a default for."""
    found = {name: _attribute(of, name) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def _profile(message: Any) -> tuple[int, str] | None:
    """Data id and mode of a message with E2EProfile P01; any other profile is refused rather than left unchecked."""
    profile = _attribute(message, "E2EProfile")
    if profile in (None, "none"):
        return None
    if profile != "P01":
        raise ValueError(f"message {message.name}: E2EProfile {profile} is not implemented; P01 or none")
    data_id = _attribute(message, "E2EDataId")
    if data_id is None:
        raise ValueError(f"message {message.name}: E2EProfile P01 without E2EDataId")
    if message.length < 2:
        raise ValueError(f"message {message.name}: E2EProfile P01 needs 2 bytes, it has {message.length}")
    try:
        profile = Profile1(int(data_id), str(_attribute(message, "E2EDataIdMode") or "both"))
    except ValueError as error:
        raise ValueError(f"message {message.name}: {error}") from None
    return profile.data_id, profile.mode


def _uncertainty_of(signal: Any) -> str:
    attributes = signal.dbc.attributes if signal.dbc is not None else {}
    return printable(str(attributes[UNCERTAINTY_OF].value)) if UNCERTAINTY_OF in attributes else ""


def _integers_if_whole(conversion: Any) -> tuple[int | float, int | float]:
    """Factor and offset: integers if both are whole (1 or 1.0) and so is the raw value, as cantools has it."""
    scale, offset = conversion.scale, conversion.offset
    whole = float(scale).is_integer() and float(offset).is_integer()
    return (int(scale), int(offset)) if whole and not conversion.is_float else (scale, offset)
