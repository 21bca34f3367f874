"""Mass and first moments of a whole machine from its sheet, and the joint prior of its bodies that weighings give.

A weighing determines sums over bodies: mass, moments of both frames about the joint, moment of height. The sheet's own accuracy shares such
a sum among the bodies, so the bodies' values are no longer independent: their prior has a full covariance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.model.description import Model
from discrepancy.models.loader.machine_variant import Variants
from identify.machine.weighing import Weighed
from plant.sheets.machine import Machine

Array = NDArray[np.float64]

NAMES: Final = ("mass", "rear moment", "front moment", "height moment")
BODY_VALUES: Final = ("rear_mass", "front_mass", "rear_x", "front_x", "rear_height", "front_height")
"""Parameters of the model on which the balances depend."""
STEP: Final = 1e-4  # kg or m, for derivatives: the balances are bilinear, so that only rounding depends on it
ITERATIONS: Final = 6  # Gauss-Newton steps: the products of mass and place are the only nonlinearity


def balances(machine: Machine) -> Array:
    """Mass [kg], moments of the rear and front frame about the joint, forward positive [kg m], and of height above ground [kg m] (4,).

    The machine stands straight with arm and bucket as carried, without payload. Wheels count to their frames.
    """
    m, wheel_z = machine, machine.geometry.wheel_centre_height
    c, s = np.cos(m.lift.carry_angle), np.sin(m.lift.carry_angle)
    pin = (m.lift.pivot_x + m.lift.arm_length * c, m.lift.pivot_z + m.lift.arm_length * s)
    wheels = 2.0 * m.wheel.mass
    rear = [
        (m.rear_frame.mass, m.rear_frame.x, m.rear_frame.z),
        (m.rear_axle.mass, m.rear_axle.x, m.rear_axle.z),
        (wheels, m.geometry.rear_axle_x, wheel_z),
    ]
    front = [
        (m.front_frame.mass, m.front_frame.x, m.front_frame.z),
        (m.front_axle.mass, m.front_axle.x, m.front_axle.z),
        (wheels, m.geometry.front_axle_x, wheel_z),
        (
            m.lift_arm.mass,
            m.lift.pivot_x + c * m.lift_arm.x - s * m.lift_arm.z,
            m.lift.pivot_z + s * m.lift_arm.x + c * m.lift_arm.z,
        ),
        (m.bucket.mass, pin[0] + m.bucket.x, pin[1] + m.bucket.z),
    ]
    both = [*rear, *front]
    return np.array([
        sum(mass for mass, _, _ in both),
        sum(mass * x for mass, x, _ in rear),
        sum(mass * x for mass, x, _ in front),
        sum(mass * z for mass, _, z in both),
    ])  # fmt: skip


def balances_at(machine: Machine, values: Mapping[str, float]) -> Array:
    """The balances (4,) of the sheet's machine with the model's parameters at these values."""
    return balances(Variants(machine).having({n: values[n] for n in BODY_VALUES if n in values}))


def derivatives(machine: Machine, values: Mapping[str, float], names: Sequence[str]) -> Array:
    """Of the balances by parameters (4, n); zero for parameters of other things than bodies."""
    out = np.zeros((len(NAMES), len(names)))
    for i, name in enumerate(names):
        if name in BODY_VALUES:
            more, less = ({**values, name: values[name] + step} for step in (STEP, -STEP))
            out[:, i] = (balances_at(machine, more) - balances_at(machine, less)) / (2.0 * STEP)
    return out


@dataclass(frozen=True, slots=True)
class JointPrior:
    """A normal prior of several parameters with a full covariance."""

    names: tuple[str, ...]
    mean: Array  # (n,)
    covariance: Array  # (n, n)

    def beginning_with(self, name: str) -> "JointPrior":
        """The same with `name` first; unchanged where it is not one of them."""
        if name not in self.names:
            return self
        order = [self.names.index(name), *(i for i, n in enumerate(self.names) if n != name)]
        return JointPrior(
            tuple(self.names[i] for i in order), self.mean[order], self.covariance[np.ix_(order, order)]
        )


def weighed_prior(machine: Machine, model: Model, weighed: Weighed) -> JointPrior:
    """The prior of the bodies' values by the sheet and by weighings: mode, and covariance by linearisation there."""
    names = [p.name for p in model.nuisances if p.name in BODY_VALUES]
    own = {n: model.parameter(n) for n in names}
    mean = np.array([own[n].value for n in names])
    sheet = np.diag([1.0 / (own[n].prior_sd or np.inf) ** 2 for n in names])
    # in units of its standard deviations: kilograms stand beside moments a hundred times larger
    size = weighed.sd[:4]
    known = np.linalg.inv(weighed.covariance[:4, :4] / np.outer(size, size)) / np.outer(size, size)
    at, information = mean.copy(), sheet
    for _ in range(ITERATIONS):
        values = dict(zip(names, at.tolist(), strict=True))
        slopes = derivatives(machine, values, names)
        error = weighed.value[:4] - balances_at(machine, values)
        information = sheet + slopes.T @ known @ slopes
        at = at + np.linalg.solve(information, slopes.T @ known @ error - sheet @ (at - mean))
    return JointPrior(tuple(names), at, np.linalg.inv(information))
