"""Defects of the thesis' measuring systems, for made recordings; each can be switched on or off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIG = ("spikes", "oscillation", "dropouts", "gain", "tare", "noise", "calibration")
FIELD = (
    "no_pulse", "drift", "delay", "duplicates", "uneven", "wrap", "spikes", "oscillation", "dropouts", "lost_event", "gain", "tare", "radius", "heading", "noise",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Defects:
    """Names of the defects that are on."""

    on: frozenset[str]

    def __contains__(self, name: str) -> bool:
        return name in self.on

    def size(self, name: str, full: float) -> float:
        """The size of a defect: `full` if it is on, else 0."""
        return full if name in self.on else 0.0


def chosen(known: tuple[str, ...], without: list[str], only: list[str] | None = None) -> Defects:
    """All known defects but some, or only some. Raises ValueError for a name that is not known."""
    if unknown := [name for name in [*without, *(only or ())] if name not in known]:
        raise ValueError(f"'{unknown[0]}' is no defect; known are {', '.join(known)}")
    return Defects(frozenset(known if only is None else only) - frozenset(without))


def spiked(value: Array, share: float, size: float, random: np.random.Generator) -> Array:
    """Single samples that jump by about `size`; share: of all."""
    hit = random.random(value.size) < share
    jump = size * random.choice([-1.0, 1.0], value.size) * random.uniform(0.5, 1.5, value.size)
    return np.where(hit, value + jump, value)


def dropped(
    value: Array, per_minute: float, rate_hz: float, longest_s: float, random: np.random.Generator
) -> Array:
    """Gaps of up to `longest_s` in which nothing is recorded (NaN)."""
    out = value.copy()
    for _ in range(random.poisson(per_minute * value.size / rate_hz / 60.0)):
        at = int(random.integers(value.size))
        out[at : at + 1 + int(random.uniform(0.0, longest_s) * rate_hz)] = np.nan
    return out


def ringing(time_s: Array, frequency_hz: float, amplitude: float, random: np.random.Generator) -> Array:
    """A narrow-band oscillation (n,): its amplitude and phase vary as in a structure excited by a road."""
    total = np.zeros(time_s.size)
    if amplitude == 0.0:
        return total
    for _ in range(8):
        f = frequency_hz * (1.0 + 0.02 * random.standard_normal())
        total += np.sin(2.0 * np.pi * f * time_s + random.uniform(0.0, 2.0 * np.pi))
    return total * amplitude / np.sqrt(8.0)
