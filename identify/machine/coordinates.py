"""A model in the coordinates of a joint prior: independent parameters of standard deviation 1 in place of correlated ones.

The engine knows one standard deviation per parameter. A prior with a covariance C = R R' becomes such priors in the coordinates z of
theta = mean + R z. The first coordinate is the first parameter alone, since R is triangular.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.model.description import Model, Parameter, Simulate, Window
from identify.machine.balances import JointPrior

Array = NDArray[np.float64]

FURTHEST: Final = 8.0  # coordinate beyond which no fit may go: bodies would lose all their mass
TYPICAL: Final = 0.5  # change of a coordinate that matters, in its standard deviation


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The map from the fitted parameters to those of the model."""

    prior: JointPrior | None  # None: both are the same

    def model(self, model: Model) -> Model:
        """The model with coordinates in place of the parameters of the joint prior."""
        if self.prior is None:
            return model
        own = tuple(
            Parameter(
                name=name,
                unit="1",
                lower=-FURTHEST,
                upper=FURTHEST,
                typical=TYPICAL,
                prior_sd=1.0,
            )
            for name in self.fitted(self.prior.names)
        )
        kept = tuple(p for p in model.nuisances if p.name not in self.prior.names)
        return replace(model, nuisances=(*own, *kept), simulate=_Mapped(model.simulate, self))

    def fitted(self, names: Sequence[str]) -> list[str]:
        """Names of the fitted parameters for those of the model."""
        known = {} if self.prior is None else {n: f"weighed.{i}" for i, n in enumerate(self.prior.names)}
        return [known.get(name, name) for name in names]

    def of_model(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the model's parameters for those of the fitted ones."""
        if self.prior is None:
            return dict(values)
        names = self.fitted(self.prior.names)
        if not any(name in values for name in names):
            return dict(values)
        z = np.array([values[name] for name in names])
        theta = self.prior.mean + np.linalg.cholesky(self.prior.covariance) @ z
        kept = {name: value for name, value in values.items() if name not in names}
        return {**kept, **dict(zip(self.prior.names, theta.tolist(), strict=True))}

    def to_fitted(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the fitted parameters for those of the model."""
        if self.prior is None or not any(name in values for name in self.prior.names):
            return dict(values)
        theta = np.array([values[name] for name in self.prior.names])
        z = np.linalg.solve(np.linalg.cholesky(self.prior.covariance), theta - self.prior.mean)
        kept = {name: value for name, value in values.items() if name not in self.prior.names}
        return {**kept, **dict(zip(self.fitted(self.prior.names), z.tolist(), strict=True))}

    def jacobian(self, names: Sequence[str]) -> Array:
        """Derivative of the model's parameters `names` by their fitted ones, both in this order (n, n)."""
        out = np.eye(len(names))
        if self.prior is not None:
            at = [list(names).index(name) for name in self.prior.names]
            out[np.ix_(at, at)] = np.linalg.cholesky(self.prior.covariance)
        return out


class _Mapped:
    """The function of a model, called with coordinates."""

    def __init__(self, simulate: Simulate, coordinates: Coordinates) -> None:
        self._simulate, self._coordinates = simulate, coordinates

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        return self._simulate(self._window(window), self._coordinates.of_model(values), extra)

    def together(
        self, windows: Sequence[Window], values: Mapping[str, float]
    ) -> Sequence[Mapping[str, Array]]:
        """The same for many windows."""
        own, theta = [self._window(w) for w in windows], self._coordinates.of_model(values)
        at_once = getattr(self._simulate, "together", None)
        return [self._simulate(w, theta, {}) for w in own] if at_once is None else list(at_once(own, theta))

    def _window(self, window: Window) -> Window:
        return replace(window, warm_up=self._coordinates.of_model(window.warm_up))
