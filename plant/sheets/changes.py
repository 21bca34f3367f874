"""Single keys laid over the TOML files of a run: KEY=VALUE with a dotted key, checked like the files themselves.

`machine.` and `equipment.` lead into the files the scenario names; every other key is the scenario's own.
"""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

from configuration import Change, ConfigurationError

FILES = ("machine", "equipment")


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes of the files' values; words: KEY=VALUE as the user gave them."""

    words: tuple[str, ...] = ()
    scenario: tuple[Change, ...] = ()
    machine: tuple[Change, ...] = ()
    equipment: tuple[Change, ...] = ()

    @classmethod
    def of(cls, words: Iterable[str]) -> Self:
        """The changes of KEY=VALUE words; of two with the same key the later one is used. Raises ConfigurationError for another form."""
        words = tuple(words)
        found: dict[str, list[Change]] = {"scenario": [], "machine": [], "equipment": []}
        for word in words:
            (first, *rest), value = _read(word)
            if first in FILES and rest:
                found[first].append((tuple(rest), value))
            else:
                found["scenario"].append(((first, *rest), value))
        return cls(words, **{file: tuple(changes) for file, changes in found.items()})

    def of_machine(self, given: Iterable[Change]) -> Self:
        """The same with more changes of the machine, which the words override."""
        return replace(self, machine=(*given, *self.machine))


UNCHANGED = Changes()


def _read(word: str) -> Change:
    key, equals, text = word.partition("=")
    path = tuple(part.strip() for part in key.split("."))
    if not equals or not all(path):
        raise ConfigurationError(f"--set {word}: is not KEY=VALUE with a key such as surface.friction")
    if path[0] == "fault":
        raise ConfigurationError(f"--set {word}: faults come with the scenario's file or with --inject")
    return path, _value(word, text.strip())


def _value(word: str, text: str) -> object:
    """A value as TOML writes it; a bare word is a text."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # no TOML, a number of thousands of digits, brackets in brackets
        table = {}
    if len(table) == 1:
        return table["value"]
    if text.replace("_", "").replace("-", "").replace("/", "").replace(".", "").isalnum():
        return text
    raise ConfigurationError(
        f"--set {word}: the value is not TOML: a number, true, a text, or a list such as [[0.0, 5.0]]"
    )
