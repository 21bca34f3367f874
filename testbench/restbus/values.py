"""The values file of a rest bus: start values, generators, and a script of what happens when.

[values]
"BodyAcceleration.Vertical" = 9.81

[[generator]]
signal = "Articulation.SampleSequence"
kind = "count"
modulo = 65536

[[at]]
time_s = 2.0
do = ["DriverDemand.BrakeDemand = 50", "stop BodyRates", "send Wakeup"]
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from configuration import CheckedTable
from testbench.restbus.core import RestBus, RestBusError
from testbench.restbus.generators import KINDS, Constant, Generator

# A day: a number beyond it is a time in another unit.
LONGEST_S = 86_400.0
VERBS = ("stop", "resume", "send")


@dataclass(frozen=True, slots=True)
class Order:
    """One line of a script, or of standard input: `Message.Signal = VALUE`, `stop|resume|send MESSAGE`."""

    verb: str
    name: str
    value: str = ""

    @classmethod
    def parse(cls, line: str) -> Self:
        """RestBusError for a line that is no order."""
        name, equals, value = line.partition("=")
        # first the form with `=`: a message may be called `stop`
        if equals and name.strip() and value.strip():
            return cls("set", name.strip(), value.strip())
        words = line.split()
        if len(words) == 2 and words[0] in VERBS:
            return cls(words[0], words[1])
        raise RestBusError(
            f"{line.strip()!r}: write Message.Signal = VALUE, or one of {', '.join(VERBS)} with a message"
        )

    def give(self, bus: RestBus, now_ns: int) -> None:
        """Carry it out; RestBusError if the bus has no such message, signal or value."""
        match self.verb:
            case "set":
                bus.set(self.name, self.value)
            case "stop":
                bus.stop(self.name)
            case "resume":
                bus.resume(now_ns, self.name)
            case "send":
                bus.send(self.name)


@dataclass(frozen=True, slots=True)
class Values:
    """The content of a values file: generators by `Message.Signal`; script: (time [s], order) by time."""

    generators: dict[str, Generator]
    script: tuple[tuple[float, Order], ...] = ()

    @classmethod
    def from_file(cls, file: Path) -> Self:
        """ConfigurationError or RestBusError names file, key and what is permitted."""
        table = CheckedTable.from_file(file)
        values = table.table("values")
        generators: dict[str, Generator] = {
            key: Constant(values.number(key, unit="the signal's unit"))
            for key in values.keys()  # noqa: SIM118
        }
        for each in table.tables("generator"):
            signal, kind = each.text("signal"), each.choice("kind", tuple(KINDS))
            generators[signal] = KINDS[kind](each)
            each.finish()
        script = [order for each in table.tables("at") for order in _orders(each)]
        table.finish()
        return cls(generators, tuple(sorted(script, key=lambda each: each[0])))


def _orders(table: CheckedTable) -> list[tuple[float, Order]]:
    time_s = table.number("time_s", unit="s", low=0.0, high=LONGEST_S)
    try:
        found = [(time_s, Order.parse(str(line))) for line in table.one_or_more("do")]
    except RestBusError as error:
        raise table.error("do", f"= {error}") from None
    table.finish()
    return found


def values_for(database_file: Path, chosen: Path | None) -> Values:
    """The chosen file, else NAME.values.toml beside NAME.dbc, else nothing."""
    beside = database_file.with_suffix(".values.toml")
    # a file of the DBC's own needs no option; one that was asked for has to exist
    if chosen is None and not beside.exists():
        return Values({})
    return Values.from_file(chosen or beside)
