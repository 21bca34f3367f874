"""The part of a recording that a user asks for, in seconds after its begin and by channel."""

from dataclasses import dataclass

from dbc.errors import LogError


class WrongPartError(LogError):
    """A recording has no such part; the message names the option."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """from_s, to_s: after the begin of the window; None: all of it. channel: the only one; None: every channel."""

    from_s: float | None = None
    to_s: float | None = None
    channel: str | None = None

    @property
    def is_timed(self) -> bool:
        """Whether it begins later or ends earlier than the recording."""
        return self.from_s is not None or self.to_s is not None

    def bounds(self, start_ns: int, end_ns: int | None) -> tuple[int, int | None]:
        """The first and the last stamp of the part, of a window of which the end may not be known yet."""
        begin_ns = start_ns + round(self.from_s * 1e9) if self.from_s is not None else start_ns
        stop_ns = start_ns + round(self.to_s * 1e9) if self.to_s is not None else end_ns
        # silence beyond the end of the recording would count as missing frames
        return begin_ns, stop_ns if end_ns is None or stop_ns is None else min(stop_ns, end_ns)

    def window(self, start_ns: int, end_ns: int) -> tuple[int, int]:
        """The part of a window; WrongPartError if there is no time in it."""
        begin_ns, stop_ns = self.bounds(start_ns, end_ns)
        if stop_ns is not None and (not self.is_timed or begin_ns < stop_ns):
            return begin_ns, stop_ns
        raise WrongPartError(
            f"--from-s {self.from_s} to --to-s {self.to_s}: nothing to judge there; "
            f"there are {(end_ns - start_ns) * 1e-9:.3f} s"
        )
