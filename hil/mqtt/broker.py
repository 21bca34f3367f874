"""The MQTT broker of the bridge: its address, the login, and TLS."""

import ssl
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bus.user_error import UserError

PORT, TLS_PORT = 1883, 8883
"""Registered for MQTT, and for MQTT over TLS (IANA)."""
SECRET_LIMIT = 4096
"""Longest file that is read as a password or key [bytes]."""


class BrokerError(UserError, ValueError):
    """The address, the login or the certificates cannot be used; the message says which and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """The address of the broker and the login."""

    host: str
    port: int
    user: str | None = None
    password: str | None = field(default=None, repr=False)  # repr=False: in no log and no traceback
    tls: ssl.SSLContext | None = None  # None: without TLS

    @classmethod
    def parse(
        cls,
        text: str,
        *,
        user: str | None = None,
        password: str | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> "Broker":
        """`HOST:PORT`, `HOST` or `[ADDRESS]:PORT`. Raises BrokerError."""
        # an IPv6 address ends with a bracket where it has no port: its colons are no separator
        host, separator, port = text.rpartition(":") if not text.endswith("]") else (text, "", "")
        if not separator:
            host, port = text, str(PORT if tls is None else TLS_PORT)
        host = host.removeprefix("[").removesuffix("]")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise BrokerError(
                f"broker '{text}': write HOST:PORT with a port from 1 to 65535, such as localhost:1883"
            )
        if password is not None and user is None:
            raise BrokerError("--password-file needs --user: MQTT has no password without a user")
        return cls(host=host, port=int(port), user=user, password=password, tls=tls)

    def options(self) -> dict[str, Any]:
        """Arguments of `aiomqtt.Client`."""
        return {
            "hostname": self.host,
            "port": self.port,
            "username": self.user,
            "password": self.password,
            "tls_context": self.tls,
        }

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def read_secret(option: str, file: Path) -> str:
    """The first line of a file that holds a password or key. Raises BrokerError; the secret is in no message."""
    try:
        with file.open("rb") as stream:
            # bounded: a wrong path may name a device or a huge file
            lines = stream.read(SECRET_LIMIT).decode().splitlines()
    except OSError as error:
        raise BrokerError(f"{option} {file}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise BrokerError(f"{option} {file}: is not text") from None
    if not lines or not lines[0]:
        raise BrokerError(f"{option} {file}: its first line is empty")
    return lines[0]


def tls_context(authority: Path | None, certificate: Path | None, key: Path | None) -> ssl.SSLContext:
    """TLS that checks the broker's certificate and name.

    authority: file of certificates to trust, None: those of the system; certificate, key: to show to the broker.
    """
    if (certificate is None) != (key is None):
        raise BrokerError("--tls-certificate and --tls-key belong together; give both or none")
    try:
        context = ssl.create_default_context(cafile=authority)
        if certificate is not None:
            context.load_cert_chain(certificate, key)
    except OSError as error:  # ssl.SSLError is one
        files = ", ".join(str(file) for file in (authority, certificate, key) if file is not None)
        raise BrokerError(f"{files}: cannot be used for TLS: {error.strerror or error}") from error
    return context
