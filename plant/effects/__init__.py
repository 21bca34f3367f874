"""Physics that the baseline machine leaves out, one named and documented effect per file, off by default.

Every module of this folder that defines EFFECT is found by itself, and so is every file of the folder
named by the environment variable LOADERHIL_EFFECTS: an effect of your own is one file.
"""

from plant.effects.effect import ActiveEffect, Confusable, Effect, Parameter
from plant.effects.registry import effects, find_effect

__all__ = ["ActiveEffect", "Confusable", "Effect", "Parameter", "effects", "find_effect"]
