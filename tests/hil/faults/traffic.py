"""Cyclic traffic of one message and what an injector makes of it, for laws about faults."""

from bus.frame import Frame
from configuration import CheckedTable
from dbc import loader_database
from dbc.protection import Protector
from hil.faults.injector import Injector
from hil.faults.table import read_fault

MS = 1_000_000
DATABASE = loader_database()


def fault(**values):
    return read_fault(CheckedTable(values, file="test", section="fault"), DATABASE)


def injector(*tables, seed=1):
    """Started at time zero."""
    made = Injector(DATABASE, [fault(**table) for table in tables], seed=seed)
    made.start(0)
    return made


def frames(message, count, values=None):
    """Protected frames of a message, one per count; values(n) gives signal values, others are 0."""
    codec = DATABASE.by_name[message]
    protector = Protector(codec) if codec.e2e_data_id is not None else None
    made = []
    for n in range(count):
        signals = {name: max(0, signal.minimum or 0) for name, signal in codec.by_signal.items()}
        data = codec.encode_dict(signals | (values(n) if values else {}))
        made.append(Frame(codec.can_id, protector.protect(data) if protector else data))
    return made


def passed(injector, sent, *, side="plant", period_ns=10 * MS):
    """Everything that goes on, in the order of departure: (at_ns, frame); sent at 0, period, 2 periods, ...

    Frames that the injector releases by itself are asked for at the times it names.
    """
    out = []
    for n, frame in enumerate(sent):
        at_ns = n * period_ns
        out += released(injector, at_ns)
        out += [(planned.at_ns, planned.frame) for planned in injector.pass_frame(side, frame, at_ns)]
    out += released(injector, len(sent) * period_ns + 10_000 * MS)
    return sorted(out, key=lambda item: item[0])


def released(injector, until_ns):
    out = []
    while (next_ns := injector.next_ns()) is not None and next_ns <= until_ns:
        out += [(next_ns, frame) for _, frame in injector.spontaneous(next_ns)]
        injector.actions(next_ns)
    return out


def values_of(frame):
    codec = DATABASE.match(frame.can_id)
    return codec.decode_dict(frame.data)
