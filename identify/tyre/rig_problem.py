"""All runs of a rig and one tyre: residuals and derivatives of the likelihood, nuisances of the measurement included.

Unknowns are the tyre's parameters, the carcass (or a constant relaxation length), the force's gain, the line of the load, and for each run
its scale factor and its tare. Certificates and calibrations enter as priors, so that their uncertainty is part of the tyre's intervals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from identify.rig.load import LoadLine
from identify.rig.preparing import Trace
from identify.tyre.parameters import INDEX, NAMES, START, TYPICAL, WIDE, Nominal, curve, vector
from identify.tyre.transient import CARCASS, COLUMNS, CONSTANT, GAIN, LAW, SCALE, TARE, response

Array = NDArray[np.float64]

CARCASS_NAME, LENGTH_NAME, CARCASS_PRESSURE = "carcass stiffness", "relaxation length", "PCFX3"
TARE_SD = 3000.0  # [N]: covers any zero of a transducer plus the rolling resistance
SCALE_SD = 2e-3  # relative: a freely rolling wheel still has the slip that overcomes its bearings


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """One number to be estimated."""

    name: str
    start: float
    lower: float
    upper: float
    typical: float  # a change that matters; the scale of the fit's steps
    prior: float = 0.0
    prior_sd: float | None = None  # None: no prior


@dataclass(frozen=True, slots=True)
class Part:
    """A run's residual and its derivatives `by @ to`, factorised because a run has fewer directions than unknowns."""

    residual: Array  # (n,)
    by: Array  # (n, m)
    to: Array  # (m, k)
    columns: NDArray[np.intp]  # indices of the unknowns (k,)
    kept: NDArray[np.bool_]  # rows that count (n,)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigProblem:
    """The joint problem of all runs and one tyre."""

    traces: Sequence[Trace]
    nominal: Nominal
    loads: LoadLine
    tyre: Sequence[str]  # parameters of the tyre that are unknown
    fixed: Mapping[str, float] = field(default_factory=dict)  # values of others
    law: int = CARCASS  # of the relaxation length: CARCASS or CONSTANT
    shortest: float = 0.05  # relaxation length below which it is not resolved [m]
    gain_sd: float = 0.005  # relative standard deviation of the force's scale, from its certificate
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=lambda: WIDE)
    carcass_pressure: bool = False
    scales: bool = True  # whether scale factors are unknown
    predictor: bool = True  # whether the measured force corrects the transient slip; without, it is simulated
    gains: Mapping[str, Array] | None = None  # of the predictor, by run; None: those of the values themselves

    @property
    def unknowns(self) -> list[Unknown]:
        """In the order of the vector of estimates."""
        out = [self._of_tyre(name) for name in self.tyre]
        if self.law_name not in self.fixed:
            out.append(self._of_law())
        if self.carcass_pressure:
            out.append(
                Unknown(name=CARCASS_PRESSURE, start=0.0, lower=-0.5, upper=2.0, typical=0.2, prior_sd=1.0)
            )
        if self.gain_sd > 0.0:
            out.append(
                Unknown(
                    name="gain",
                    start=1.0,
                    lower=0.8,
                    upper=1.2,
                    typical=0.01,
                    prior=1.0,
                    prior_sd=self.gain_sd,
                )
            )
            out += [
                Unknown(name=f"load {i}", start=0.0, lower=-10.0, upper=10.0, typical=1.0, prior_sd=1.0)
                for i in (0, 1)
            ]
        for trace in self.traces:
            tare = (
                float(np.nanmedian(trace.force[: round(1.0 / trace.step)]))
                if trace.kept[: round(1.0 / trace.step)].any()
                else 0.0
            )
            out.append(
                Unknown(
                    name=f"tare {trace.name}",
                    start=tare,
                    lower=-2e4,
                    upper=2e4,
                    typical=100.0,
                    prior_sd=TARE_SD,
                )
            )
            if self.scales:
                out.append(
                    Unknown(
                        name=f"scale {trace.name}",
                        start=0.0,
                        lower=-0.05,
                        upper=0.05,
                        typical=1e-3,
                        prior_sd=SCALE_SD,
                    )
                )
        return out

    @property
    def law_name(self) -> str:
        return CARCASS_NAME if self.law == CARCASS else LENGTH_NAME

    def _of_tyre(self, name: str) -> Unknown:
        low, high = self.bounds.get(name, WIDE[name])
        start = self.fixed.get(name, START.get(name, 0.0))
        return Unknown(
            name=name, start=float(np.clip(start, low, high)), lower=low, upper=high, typical=TYPICAL[name]
        )

    def _of_law(self) -> Unknown:
        if self.law == CONSTANT:
            return Unknown(name=LENGTH_NAME, start=0.4, lower=0.01, upper=5.0, typical=0.05)
        stiffness = START["PKX1"] * self.nominal.load / 0.4
        return Unknown(
            name=CARCASS_NAME,
            start=stiffness,
            lower=1e-2 * stiffness,
            upper=50.0 * stiffness,
            typical=0.1 * stiffness,
        )

    def parts(self, values: Mapping[str, float]) -> list[Part]:
        """Residual (model minus measurement) and derivatives of every run. values: by unknown, those of `unknowns`."""
        return self._parts(values, self.gains)

    def _parts(self, values: Mapping[str, float], gains: Mapping[str, Array] | None) -> list[Part]:
        index = {name: i for i, name in enumerate(values)}
        p = vector({**self.fixed, **{name: values[name] for name in self.tyre}})
        return [
            self._part(t, p, values, index, np.zeros(t.speed.size) if gains is None else gains[t.name])
            for t in self.traces
        ]

    def held_at(self, values: Mapping[str, float]) -> "RigProblem":
        """The same problem with the predictor's gains of these values, which then no longer move with the unknowns."""
        gains = {trace.name: np.zeros(trace.speed.size) for trace in self.traces}
        replace(self, gains=None)._parts(values, gains)
        return replace(self, gains=gains)

    def predicted(self, trace: Trace, values: Mapping[str, float]) -> Array:
        """Force that the rig would have measured (n,) [N]."""
        [part] = replace(self, traces=[trace])._parts(values, self.gains)
        return part.residual + np.where(trace.kept, trace.force, 0.0)

    def _part(
        self,
        trace: Trace,
        p: Array,
        values: Mapping[str, float],
        index: Mapping[str, int],
        gains: Array,
    ) -> Part:
        shift = np.array([values.get("load 0", 0.0), values.get("load 1", 0.0)])
        row = self.loads.row(trace.piston_pressure)
        load = float(row @ (self.loads.line + self.loads.root @ shift))
        curve_, by_p, by_load = curve(p, self.nominal, load, trace.inflation)
        law = values.get(self.law_name, self.fixed.get(self.law_name, 0.0))
        dp = trace.inflation / self.nominal.pressure - 1.0
        softer = 1.0 + values.get(CARCASS_PRESSURE, 0.0) * dp
        scale = values.get(f"scale {trace.name}", 0.0)
        gain, tare = values.get("gain", 1.0), values.get(f"tare {trace.name}", 0.0)
        n = trace.speed.size
        kappa, force, by = np.empty(n), np.empty(n), np.empty((n, COLUMNS))
        noise = trace.sliding_sd if self.predictor else np.zeros(n)
        response(
            self.law, law * softer, self.shortest, curve_, trace.speed, trace.wheel * (1.0 + scale), trace.step, 0.0,
            trace.force, gain, tare, noise, trace.force_sd, self.gains is not None, gains, kappa, force, by,
        )  # fmt: skip
        columns: dict[int, Array] = {}

        def put(name: str, rows: slice | int, value: Array | float) -> None:
            if name in index:
                column = np.zeros(COLUMNS)
                column[rows] = value
                columns[index[name]] = column

        for name in self.tyre:
            put(name, slice(0, 7), by_p[:, INDEX[name]])
        put(self.law_name, LAW, softer)
        put(CARCASS_PRESSURE, LAW, law * dp)
        put("gain", GAIN, 1.0)
        for i, part in enumerate((row @ self.loads.root).tolist()):
            put(f"load {i}", slice(0, 7), by_load * part)
        put(f"tare {trace.name}", TARE, 1.0)
        put(f"scale {trace.name}", SCALE, 1.0 / (1.0 + scale))
        residual = force - np.where(trace.kept, trace.force, 0.0)
        return Part(
            residual,
            by,
            np.stack(list(columns.values()), axis=1),
            np.array(list(columns), np.intp),
            trace.kept,
        )


__all__ = ["CARCASS_NAME", "CARCASS_PRESSURE", "LENGTH_NAME", "NAMES", "Part", "RigProblem", "Unknown"]
