"""Parameters of the longitudinal Magic Formula, their bounds in the thesis, and the curve they make at a load and a pressure.

Names are those of tyre property files (.tir). Load and pressure enter as in the corrected (14) to (24): relative to nominal.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NAMES = (
    "PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX3", "PEX4", "PKX1", "PKX2", "PKX3",
    "PHX1", "PHX2", "PVX1", "PVX2", "PPX1", "PPX2", "PPX3", "PPX4",
)  # fmt: skip
INDEX = {name: i for i, name in enumerate(NAMES)}
COMBINED = ("RBX1", "RBX2", "RCX1", "REX1")
"""Of the weight that a slip angle gives the longitudinal force (`identify.tyre.combined`)."""

MEANINGS = {
    "PCX1": "shape", "PDX1": "friction at nominal load", "PDX2": "change of friction with load",
    "PEX1": "curvature", "PEX2": "change of curvature with load", "PEX3": "the same, squared", "PEX4": "difference of curvature between driving and braking",
    "PKX1": "slip stiffness over load", "PKX2": "its change with load", "PKX3": "exponent of that change",
    "PHX1": "horizontal shift", "PHX2": "its change with load", "PVX1": "vertical shift over load", "PVX2": "its change with load",
    "PPX1": "change of stiffness with pressure", "PPX2": "the same, squared", "PPX3": "change of friction with pressure", "PPX4": "the same, squared",
    "RBX1": "how steeply the force falls with the slip angle", "RBX2": "how much less steeply at large slip", "RCX1": "shape of this fall", "REX1": "its curvature",
}  # fmt: skip

RIG_NOMINAL = {"PCX1": (1.0, 3.0), "PDX1": (0.0, 2.0), "PKX1": (1.0, 20.0), "PEX1": (-20.0, 1.0), "PHX1": (-1.0, 1.0), "PVX1": (-1e3, 1e3)}  # fmt: skip
"""(125). PVX1 is a ratio of forces, so that its bounds are none."""
RIG_LOAD = {
    "PEX2": (-10.0, 2.0), "PEX3": (-100.0, 2.0), "PEX4": (-10.0, 2.0), "PDX2": (-10.0, 2.0), "PKX2": (0.0, 50.0), "PKX3": (-10.0, 10.0),
    "PHX2": (-1.0, 1.0), "PVX2": (-10.0, 10.0),
}  # fmt: skip
"""(126)."""
RIG_PRESSURE = dict.fromkeys(("PPX1", "PPX2", "PPX3", "PPX4"), (-10.0, 100.0))
"""(127)."""
FIELD_NOMINAL = {"PCX1": (1.0, 2.0), "PDX1": (0.0, 2.0), "PKX1": (0.0, 20.0), "PEX1": (-4.0, 1.0)}
"""Asphalt, (120)."""
FIELD_LOAD = {
    "PDX2": (-2.0, 2.0),
    "PKX2": (0.0, 20.0),
    "PKX3": (-1.0, 1.0),
    "PEX2": (-4.0, 4.0),
    "PEX3": (-4.0, 4.0),
}
"""Asphalt, (121)."""
GRAVEL = {"PKX1": (1.0, 20.0), "PKX2": (1.0, 20.0), "PKX3": (-0.1, 0.0)}
"""(119). PKX2 of 1 or more cannot be the linear term of a tyre: the printed form squares the load."""
BRUSH = {"friction": (0.0, 1.0), "slip_stiffness": (1.0, 1e7)}
"""(122)-(124)."""
WIDE = {
    **RIG_NOMINAL, **RIG_LOAD, **RIG_PRESSURE,
    "PVX1": (-0.1, 0.1), "PVX2": (-0.1, 0.1), "PHX1": (-0.1, 0.1), "PHX2": (-0.1, 0.1),
    "PDX1": (0.05, 2.0), "PKX2": (-50.0, 50.0), "PDX2": (-2.0, 2.0), "PEX2": (-50.0, 50.0), "PEX3": (-100.0, 50.0), "PEX4": (-1.0, 1.0),
    "PPX1": (-2.0, 2.0), "PPX2": (-2.0, 2.0), "PPX3": (-1.0, 1.0), "PPX4": (-1.0, 1.0),
    "RBX1": (0.1, 50.0), "RBX2": (0.0, 50.0), "RCX1": (0.1, 1.0), "REX1": (-10.0, 1.0),
}  # fmt: skip
"""Those of the thesis where they are physical, else what a tyre can have: its bounds of PKX2 and PDX2 exclude tyres that were measured.

RBX2 acts by its square, so that it has no sign; an RCX1 beyond 1 would turn the force round at a large slip angle."""

START = {
    "PCX1": 1.5,
    "PDX1": 0.8,
    "PKX1": 8.0,
    "PEX1": 0.0,
    "RBX1": 10.0,
    "RBX2": 8.0,
    "RCX1": 0.95,
    "REX1": 0.0,
}
"""Where a fit begins; other parameters begin at 0."""
TYPICAL = {
    "PCX1": 0.1, "PDX1": 0.1, "PDX2": 0.1, "PEX1": 0.5, "PEX2": 1.0, "PEX3": 1.0, "PEX4": 0.1, "PKX1": 1.0, "PKX2": 1.0, "PKX3": 0.2,
    "PHX1": 0.005, "PHX2": 0.005, "PVX1": 0.01, "PVX2": 0.01, "PPX1": 0.3, "PPX2": 0.3, "PPX3": 0.1, "PPX4": 0.1,
    "RBX1": 3.0, "RBX2": 5.0, "RCX1": 0.1, "REX1": 0.5,
}  # fmt: skip
"""Changes that matter: the scale in which a fit takes its steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """What parameters are relative to."""

    load: float  # F_zo [N]
    pressure: float  # p_io [Pa]
    radius: float  # of the unloaded tyre, R0 [m]


def vector(values: Mapping[str, float]) -> Array:
    """Parameters in the order of NAMES (18,), those not given 0."""
    return np.array([values.get(name, 0.0) for name in NAMES])


def curve(p: Array, nominal: Nominal, load: float, pressure: float) -> tuple[Array, Array, Array]:
    """The curve (7,) at a load [N] and a pressure [Pa], its derivative by the parameters (7, 18) and by the load (7,)."""
    v = dict(zip(NAMES, p.tolist(), strict=True))
    df, dp = load / nominal.load - 1.0, pressure / nominal.pressure - 1.0
    grow, base = np.exp(v["PKX3"] * df), v["PKX1"] + v["PKX2"] * df
    soft = 1.0 + v["PPX1"] * dp + v["PPX2"] * dp * dp
    grip, less = v["PDX1"] + v["PDX2"] * df, 1.0 + v["PPX3"] * dp + v["PPX4"] * dp * dp
    bend = v["PEX1"] + v["PEX2"] * df + v["PEX3"] * df * df
    by_df = v["PEX2"] + 2.0 * v["PEX3"] * df
    stiffness, peak = load * base * grow * soft, load * grip * less
    out = np.array([
        stiffness, v["PCX1"], peak, bend * (1.0 - v["PEX4"]), bend * (1.0 + v["PEX4"]),
        v["PHX1"] + v["PHX2"] * df, load * (v["PVX1"] + v["PVX2"] * df),
    ])  # fmt: skip
    by = np.zeros((7, len(NAMES)))

    def put(row: int, **columns: float) -> None:
        for name, value in columns.items():
            by[row, INDEX[name]] = value

    of_k = load * grow * soft
    put(
        0,
        PKX1=of_k,
        PKX2=of_k * df,
        PKX3=stiffness * df,
        PPX1=load * base * grow * dp,
        PPX2=load * base * grow * dp * dp,
    )
    put(1, PCX1=1.0)
    put(2, PDX1=load * less, PDX2=load * less * df, PPX3=load * grip * dp, PPX4=load * grip * dp * dp)
    for row, sign in ((3, -1.0), (4, 1.0)):
        side = 1.0 + sign * v["PEX4"]
        put(row, PEX1=side, PEX2=side * df, PEX3=side * df * df, PEX4=sign * bend)
    put(5, PHX1=1.0, PHX2=df)
    put(6, PVX1=load, PVX2=load * df)
    per = load / nominal.load  # d(df)/d(load) times the load
    by_load = np.array([
        base * grow * soft + per * (v["PKX2"] * grow + base * grow * v["PKX3"]) * soft, 0.0, grip * less + per * v["PDX2"] * less,
        by_df * (1.0 - v["PEX4"]) / nominal.load, by_df * (1.0 + v["PEX4"]) / nominal.load,
        v["PHX2"] / nominal.load, v["PVX1"] + v["PVX2"] * df + per * v["PVX2"],
    ])  # fmt: skip
    return out, by, by_load
