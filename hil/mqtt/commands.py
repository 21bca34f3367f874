"""Passes commands from a broker on to a gateway, after checking their key.

Every client that may publish on the topic of commands could end or falsify a bench. MQTT does not say who published a
message, so each command has to carry a key that the user of the bench has chosen.
"""

import hmac
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bus.bounded_json import read_object
from bus.user_error import UserError
from hil.faults.control import REQUEST_LIMIT, ask

LEAST_KEY = 16
"""Shortest key [characters]."""


class KeyTooShort(UserError, ValueError):
    """The key of commands could be guessed."""


@dataclass(frozen=True, slots=True)
class Commands:
    """Passes commands on to the control socket of a gateway."""

    control: Path  # the control socket
    key: str = field(repr=False)  # that a command must have as its "key"

    def __post_init__(self) -> None:
        if len(self.key) < LEAST_KEY:
            raise KeyTooShort(f"--command-key: {len(self.key)} characters; take at least {LEAST_KEY}")

    def obey(self, payload: Any) -> dict[str, Any]:
        """The control socket's answer to a command; `id`, if the command has one, comes back with the answer."""
        if not isinstance(payload, bytes | bytearray):
            return {"ok": False, "error": "a command is a JSON object, as `loaderhil inject` sends it"}
        try:
            command = read_object(bytes(payload), REQUEST_LIMIT)
        except ValueError as error:
            return {"ok": False, "error": f"a command is a JSON object: {error}"}
        number = {"id": command.pop("id")} if "id" in command else {}
        # removed before it is passed on: the gateway may log commands. compare_digest takes the same time for every
        # wrong key, so that none can be guessed piece by piece.
        shown = command.pop("key", None)
        if not isinstance(shown, str) or not hmac.compare_digest(_bytes(shown), _bytes(self.key)):
            return {"ok": False, "error": "the key is missing or wrong"} | number
        try:
            return ask(self.control, command) | number
        except UserError as error:
            return {"ok": False, "error": str(error)} | number


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")
