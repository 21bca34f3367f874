"""Writes the reference page of a DBC file as Markdown, for `scripts/dbc-docs` and docs/reference."""

from bus.frame import EXTENDED, EXTENDED_MASK
from dbc.database import Database, MessageCodec
from dbc.j1939 import pgn
from dbc.load import bus_load
from dbc.signal import Signal

BIT_RATE = 500_000


def page(title: str, database: Database, bit_rate: int = BIT_RATE) -> str:
    """Messages by sender, then every message with its signals."""
    load = bus_load(database.by_name.values(), bit_rate)
    lines = [
        f"# {title}",
        "",
        "Written from the DBC by `scripts/dbc-docs`; do not edit.",
        "",
        f"{len(database.by_name)} messages, {load.frames_per_s:.0f} frames/s; at {bit_rate // 1000} kbit/s they take "
        f"{100 * load.least:.0f} % of the bus without stuff bits and {100 * load.most:.0f} % with as many as there can be.",
        "",
        "| message | identifier | PGN | cycle | sender | protection |",
        "|---|---|---|---|---|---|",
        *(_overview(codec) for codec in database.by_name.values()),
        *_conduct(database),
    ]
    for codec in database.by_name.values():
        lines += _message(codec)
    return "\n".join(lines) + "\n"


def _overview(codec: MessageCodec) -> str:
    group = str(pgn(codec.can_id)) if codec.is_j1939 else "–"
    cycle = f"{codec.cycle_ns // 1_000_000} ms" if codec.cycle_ns else "–"
    protection = _protection(codec)
    return (
        f"| [{codec.name}](#{codec.name.lower()}) | {_identifier(codec)} | {group} | {cycle} "
        f"| {', '.join(codec.senders) or '–'} | {protection} |"
    )


def _identifier(codec: MessageCodec) -> str:
    return f"0x{codec.can_id & EXTENDED_MASK:08X}" if codec.can_id & EXTENDED else f"0x{codec.can_id:03X}"


def _protection(codec: MessageCodec) -> str:
    """Profile, data id, and how the id goes into the CRC."""
    profile = codec.profile
    return "–" if profile is None else f"P01, data id 0x{profile.data_id:04X} ({profile.mode})"


def _conduct(database: Database) -> list[str]:
    """What the DBC asks of the controllers on the bus; nothing where it does not say."""
    lines = []
    for name, node in database.nodes.items():
        if not node.state_signal:
            continue
        lines += [
            "",
            f"## What {name} does when inputs are lost",
            "",
            f"`{node.state_signal}` is *{node.running}* {node.start_ns // 1_000_000} ms after the first frame at the latest, with all inputs there, and "
            f"{node.recovery_ns // 1_000_000} ms after a lost input is back.",
            "",
            "| input lost | state that follows | within |",
            "|---|---|---|",
            *(
                f"| {codec.name} | {codec.conduct.state} | {codec.conduct.timeout_ns // 1_000_000} ms |"
                for codec in database.by_name.values()
                if codec.conduct.state and name in codec.receivers
            ),
        ]
    return lines


def _message(codec: MessageCodec) -> list[str]:
    return [
        "",
        f"## {codec.name}",
        "",
        codec.comment,
        "",
        f"{_identifier(codec)}, {codec.length} bytes, to {', '.join(codec.receivers) or 'nobody in particular'}."
        + (" Optional: its sender may leave it out." if codec.is_optional else ""),
        "",
        "| signal | bits | factor | range | unit | meaning |",
        "|---|---|---|---|---|---|",
        *(_signal(signal) for signal in codec.layout),
    ]


def _signal(signal: Signal) -> str:
    kind = "float" if signal.is_float else "signed" if signal.signed else "unsigned"
    bits = f"{signal.start}\\|{signal.length} {kind}" + (" Motorola" if signal.big_endian else "")
    span = f"{signal.minimum:g} … {signal.maximum:g}" if signal.has_range else "–"
    values = "; ".join(f"{number} {name}" for number, name in sorted(signal.choices.items()))
    meaning = signal.comment + (f" ({values})" if values else "")
    factor = f"{signal.scale:g}" + (f", offset {signal.offset:g}" if signal.offset else "")
    return f"| {signal.name} | {bits} | {factor} | {span} | {signal.unit or '–'} | {meaning} |"
