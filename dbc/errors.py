"""Error classes of DBC files, frames and recordings."""

from bus.user_error import UserError


class DatabaseError(UserError, ValueError):
    """A DBC file cannot be used; the message names file, message, signal and cause."""


class DecodeError(ValueError):
    """A frame's data do not fit its message: too short, or an unknown multiplexer value."""


class EncodeError(ValueError):
    """A value does not fit its signal, or is missing."""


class LogError(UserError, ValueError):
    """A recording cannot be read at all; damaged lines of a readable one are no error."""
