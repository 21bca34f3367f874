"""Writes time, speed, the ECU's warning and each wheel's load onto a rendered frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from hil.rundir import RunDirectory
from report.render.loader import METRES_PER_NEWTON
from report.render.raster import Pixels

STATES = {0: "stable", 1: "attention", 2: "warning", 3: "imminent", 4: "wheel lifted"}
COLOURS = {
    "stable": (46, 125, 70),
    "attention": (201, 162, 39),
    "warning": (224, 122, 20),
    "imminent": (200, 40, 30),
    "wheel lifted": (150, 20, 60),
    "no estimate": (110, 115, 120),
    "not recorded": (110, 115, 120),
}
INK, PALE, BAR, EMPTY = (28, 30, 33), (250, 250, 250), (0, 115, 204), (214, 61, 13)
# Length of a full bar [N]: about the load of one front wheel with a full bucket.
FULL_BAR_N = 60e3
WHEELS = ("FL", "FR", "RL", "RR")


@dataclass(frozen=True, slots=True)
class WarningLine:
    """The ECU's roll-over state over time; words[i] is valid from time_s[i] on."""

    time_s: np.ndarray[Any, np.dtype[np.float64]]
    words: tuple[str, ...]

    @classmethod
    def of(cls, run: RunDirectory) -> "WarningLine":
        """From the frames of a run; empty where the ECU sent none."""
        columns = run.messages.get("RollOver")
        if columns is None:
            return cls(np.empty(0), ())
        state, valid = columns.signals["State"], columns.signals["Valid"]
        words = tuple(
            STATES.get(int(s), "no estimate") if v > 0 else "no estimate"
            for s, v in zip(state, valid, strict=True)
        )
        return cls(np.asarray(columns.time_s, float), words)

    def at(self, time_s: float) -> str:
        """The state at a time [s]."""
        # the newest frame at that time: what a driver would have seen
        index = int(np.searchsorted(self.time_s, time_s, side="right")) - 1
        return self.words[index] if index >= 0 else "not recorded" if not self.words else "no estimate"


def written(pixels: Pixels, time_s: float, instant: Mapping[str, Any], speed: float, warning: str) -> Pixels:
    """The frame with its texts. speed [m/s]. During a warning the frame has a border in the warning's colour."""
    image = Image.fromarray(pixels)
    draw = ImageDraw.Draw(image)
    unit = max(image.height // 30, 9)  # height of a letter
    font = ImageFont.load_default(unit)
    colour = COLOURS[warning]
    if warning in ("warning", "imminent", "wheel lifted"):
        draw.rectangle((0, 0, image.width - 1, image.height - 1), outline=colour, width=max(unit // 3, 2))
    draw.text((unit, unit * 0.8), f"{time_s:6.2f} s   {3.6 * speed:5.1f} km/h", INK, font)
    text = f"ECU: {warning}"
    width = draw.textlength(text, font)
    box = (image.width - width - 3 * unit, unit * 0.6, image.width - unit, unit * 2.4)
    draw.rounded_rectangle(box, unit // 2, colour)
    draw.text((image.width - width - 2 * unit, unit * 0.8), text, PALE, font)
    _bars(draw, font, unit, np.asarray(instant["normal_force"], float))
    key = f"arrows: 1 m = {1e-3 / METRES_PER_NEWTON:.0f} kN, grid 1 m"
    place = (image.width - draw.textlength(key, font) - unit, image.height - 1.8 * unit)
    draw.text(place, key, INK, font)
    return np.asarray(image)


def _bars(
    draw: ImageDraw.ImageDraw, font: Any, unit: int, force: np.ndarray[Any, np.dtype[np.float64]]
) -> None:
    """Top left, below the time."""
    for wheel, (name, load) in enumerate(zip(WHEELS, force.tolist(), strict=True)):
        left, top = unit, (2.8 + 1.5 * wheel) * unit
        length = 4 * unit * min(load / FULL_BAR_N, 1.0)
        draw.text((left, top), name, INK, font)
        frame = (left + 1.8 * unit, top + 0.2 * unit, left + 5.8 * unit, top + unit)
        draw.rectangle(frame, PALE, INK)
        if load > 0:
            draw.rectangle((frame[0], frame[1], frame[0] + length, frame[3]), BAR)
        draw.text((left + 6.1 * unit, top), f"{load * 1e-3:.0f} kN", INK if load > 0 else EMPTY, font)
