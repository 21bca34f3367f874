"""Seed and key: who knows the secret may change the ECU's behaviour.

The key is the HMAC-SHA256 of purpose and seed under a secret that only the user's file holds. Nothing that passes on the
bus gives the secret away, and a key that was overheard does not fit the next seed.
"""

import hmac
from collections.abc import Callable
from pathlib import Path
from typing import Final

from bus.user_error import UserError

SEED_BYTES: Final = 12
"""96 random bits do not repeat. On CAN, XCP sends it in two packets; pyxcp 0.29 reads no more than two."""
KEY_BYTES: Final = 16
LEAST_SECRET: Final = 16
"""Shortest secret [bytes]: shorter ones can be found by trying."""
MOST_SECRET: Final = 4096
CALIBRATE, DIAGNOSE = b"xcp calibration", b"uds security access"
"""Purposes: a key for one of them does not open the other."""


class SecretError(UserError, OSError):
    """The file with the secret cannot be used."""


def key_of(secret: bytes, purpose: bytes, seed: bytes) -> bytes:
    """The key for a seed, KEY_BYTES long."""
    return hmac.digest(secret, purpose + b"\0" + seed, "sha256")[:KEY_BYTES]


def read_secret(file: Path) -> bytes:
    """The secret in a file, without the line end behind it. Raises SecretError."""
    try:
        with file.open("rb") as opened:
            secret = opened.read(MOST_SECRET + 1).rstrip(b"\r\n")
    except OSError as error:
        raise SecretError(f"{file}: cannot be read: {error.strerror}") from error
    if not LEAST_SECRET <= len(secret) <= MOST_SECRET:
        raise SecretError(
            f"{file}: a secret has {LEAST_SECRET} to {MOST_SECRET} bytes, this file {len(secret)}; "
            "head -c 32 /dev/urandom | base64 makes one"
        )
    return secret


class Lock:
    """One thing behind seed and key. Without a secret it stays closed."""

    def __init__(self, secret: bytes | None, purpose: bytes, random: Callable[[int], bytes]) -> None:
        """random: a source of seeds that nobody can foresee, such as secrets.token_bytes."""
        self._secret, self._purpose, self._random = secret, purpose, random
        self._seed: bytes | None = None
        self.open = False

    def seed(self) -> bytes:
        """A new seed; the one before is void."""
        self._seed = self._random(SEED_BYTES)
        return self._seed

    def unlock(self, key: bytes) -> bool:
        """Try a key for the last seed; a seed serves one try."""
        seed, self._seed = self._seed, None
        if seed is None or self._secret is None:
            return False
        self.open = hmac.compare_digest(key, key_of(self._secret, self._purpose, seed))
        return self.open

    def close(self) -> None:
        """Lock it again."""
        self.open, self._seed = False, None
