"""Mass, first moments of both frames, and height of the centre of gravity, from the wheel loads of a standing machine.

Every weighing gives three balances: weight, and moments about two axes of the rear frame. They are linear in the unknowns, so the estimate is
a single least-squares problem with its covariance. Axes: x forward along the rear frame from the joint, y to the left; articulation and bank positive to the left (ISO 8855).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

G = 9.81
NAMES = ("mass", "rear moment", "front moment", "height moment", "roll zero", "scale zero")
UNITS = ("kg", "kg m", "kg m", "kg m", "rad", "N")
"""Mass; m_r x_r and m_f x_f of the frames; mass times height; zero of the bank's sensor; common zero of the four scales."""
# nothing is known of the first four; zeros of a slope sensor and of scales are small
PRIOR_SD = (1e6, 1e6, 1e6, 1e6, 0.05, 30.0)
DETERMINED = (0.02, 0.05, 0.05, 0.15)
"""Half width of a 95 % interval over the typical size of the first four, beyond which they count as not determined."""
STEPS = {
    "mass": "weigh all four wheels at once",
    "rear moment": "weigh with the machine straight and articulated by 30 degrees or more to both sides",
    "front moment": "weigh with the machine straight and articulated by 30 degrees or more to both sides",
    "height moment": "weigh on a grade of 5 degrees or more, facing up and facing down, or on a bank to both sides",
    "roll zero": "weigh at the same place facing both ways",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """Geometry of the machine [m]."""

    front: float  # distance of the front axle from the joint
    rear: float  # distance of the rear axle from the joint
    track: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighing:
    """One weighing."""

    loads: Array  # front left, front right, rear left, rear right (4,) [N], perpendicular to the ground
    articulation: float = 0.0  # [rad], left positive
    grade: float = 0.0  # [rad], nose up positive
    bank: float = 0.0  # [rad], left side up positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighed:
    """The result of all weighings."""

    value: Array  # in the order of NAMES
    sd: Array
    covariance: Array  # of `value` (6, 6)
    excess: float  # scatter of the balances over its expected value
    undetermined: tuple[tuple[str, str], ...]  # name, and the weighing that would determine it
    odd: tuple[int, ...]  # numbers of weighings that do not fit the others

    @property
    def height(self) -> float:
        """Height of the centre of gravity above the ground [m]."""
        return float(self.value[3] / self.value[0])


def positions(geometry: Geometry, articulation: float) -> Array:
    """Wheels (4, 2) in the axes of the rear frame [m]."""
    c, s, half = np.cos(articulation), np.sin(articulation), 0.5 * geometry.track
    return np.array([
        [geometry.front * c - half * s, geometry.front * s + half * c],
        [geometry.front * c + half * s, geometry.front * s - half * c],
        [-geometry.rear, half],
        [-geometry.rear, -half],
    ])  # fmt: skip


def weighed(weighings: Sequence[Weighing], geometry: Geometry, load_sd: float) -> Weighed:
    """Least squares over all balances; load_sd: of one scale [N]. Raises ValueError for loads that a standing machine cannot have."""
    if not weighings:
        raise ValueError("no weighings were given")
    rows, targets, sizes = [], [], []
    for number, w in enumerate(weighings, 1):
        if w.loads.shape != (4,) or not np.isfinite(w.loads).all():
            raise ValueError(
                f"weighing {number}: four loads are needed, front left, front right, rear left, rear right"
            )
        if np.any(w.loads < 0.0):
            raise ValueError(
                f"weighing {number}: a load is below 0 N: a scale was zeroed under load, or its sign is wrong"
            )
        place = positions(geometry, w.articulation)
        down = G * np.cos(w.grade) * np.cos(w.bank)
        total = float(w.loads.sum())
        c, s = np.cos(w.articulation), np.sin(w.articulation)
        # Balances of weight, and of moments about two axes: the moments of the wheel loads equal those of gravity, which come from the first
        # moments and, on a slope, from the height.
        rows += [
            [down, 0.0, 0.0, 0.0, 0.0, 4.0],
            [0.0, down, down * c, -G * np.sin(w.grade), 0.0, float(place[:, 0].sum())],
            [0.0, 0.0, down * s, -G * np.sin(w.bank), -total * 1.0, float(place[:, 1].sum())],
        ]
        targets += [total, float(w.loads @ place[:, 0]), float(w.loads @ place[:, 1])]
        sizes += [
            2.0 * load_sd,
            load_sd * float(np.linalg.norm(place[:, 0])),
            load_sd * float(np.linalg.norm(place[:, 1])),
        ]
    # The zero of the roll sensor acts through the height of the centre of gravity, taken as 1 m here: exact enough for so small an angle.
    A, b, size = np.array(rows), np.array(targets), np.array(sizes)
    prior = np.array(PRIOR_SD)
    scaled = (
        A * prior / size[:, None]
    )  # in units of the priors, so that an unknown without data keeps its prior
    spread = np.linalg.inv(scaled.T @ scaled + np.eye(len(prior)))
    covariance = spread * np.outer(prior, prior)
    value = prior * (spread @ (scaled.T @ (b / size)))
    residual = (b - A @ value) / size
    excess = float(np.sqrt(np.mean(residual**2)))
    covariance = covariance * max(1.0, excess) ** 2
    sd = np.sqrt(np.diag(covariance))
    typical = (value[0], value[0], value[0], value[0])
    undetermined = tuple(
        (name, f"{STEPS[name]} (95 % interval ± {1.96 * s:.3g} {unit})")
        for name, unit, s, limit, t in zip(NAMES, UNITS, sd, DETERMINED, typical, strict=False)
        if not 1.96 * s < limit * abs(t)
    )
    odd = tuple(
        i + 1
        for i in range(len(weighings))
        if np.max(np.abs(residual[3 * i : 3 * i + 3])) > 5.0 * max(1.0, float(np.median(np.abs(residual))))
    )
    return Weighed(
        value=value,
        sd=np.asarray(sd, float),
        covariance=covariance,
        excess=excess,
        undetermined=undetermined,
        odd=odd,
    )
