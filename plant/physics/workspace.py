"""The workspace of one evaluation of the equations of motion: intermediate and final results, allocated once."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.physics.kinematics import Places, new_places
from plant.physics.multibody import Tree, new_tree
from plant.physics.parameters import WHEEL_SIZE
from plant.physics.state import GROUND, STATES, T_OUTPUTS

Array = NDArray[np.float64]


class Workspace(NamedTuple):
    """Everything but the state itself, all vectors in the rear frame's axes about the articulation joint."""

    tree: Tree
    places: Places
    tyres: Array  # (4, T_OUTPUTS)
    rate: Array  # (STATES,)
    whole: Array  # mass and centre of gravity (3) of the machine
    normal: Array  # (3) road normal
    local: Array  # (4, WHEEL_SIZE) each tyre's block as effects have changed it for this instant
    ground: Array  # (4, GROUND) what effects have done to the ground under each wheel
    scratch: Array  # (2, STATES) of the Runge-Kutta method
    ahead: (
        Array  # (1,) step [s] at whose end an effect's fast states are to be taken, 0 for the true derivative
    )


def new_workspace() -> Workspace:
    """An empty workspace."""
    return Workspace(
        new_tree(),
        new_places(),
        np.zeros((4, T_OUTPUTS)),
        np.zeros(STATES),
        np.zeros(4),
        np.zeros(3),
        np.zeros((4, WHEEL_SIZE)),
        np.zeros((4, GROUND)),
        np.zeros((2, STATES)),
        np.zeros(1),
    )
