"""Draws residuals over frequency and lag. Residuals of a complete model are white: a flat spectrum and no autocorrelation."""

import numpy as np

from diagnosis.page.figure import figure, versions
from discrepancy.decision.evidence import Spectrum
from discrepancy.signals.recording import Array
from report.kit.axis import Axis, around, number
from report.kit.plot import Curve

FLOOR = 1e-3  # of the power of white noise; lower values are drawn there, so that one deep notch does not set the scale


def power(spectrum: Spectrum) -> str:
    """Power over frequency, both logarithmic, 1 where residuals are white."""
    curves = versions(spectrum.before, spectrum.after)
    across = Axis(float(np.log10(spectrum.frequency_hz[0])), float(np.log10(spectrum.frequency_hz[-1])))
    values = [(name, np.log10(np.maximum(value, FLOOR)), style) for name, value, style in curves]
    upward = around((v for _, v, _ in values), (-0.5, 0.5))
    ticks = range(int(np.ceil(across.start)), int(np.floor(across.end)) + 1)
    x_labels = [(float(t), number(10.0**t)) for t in ticks]
    y_labels = [
        (float(t), f"10{_raised(t)}")
        for t in range(int(np.ceil(upward.start)), int(np.floor(upward.end)) + 1)
    ]
    drawn = [Curve(name, np.log10(spectrum.frequency_hz), value, style) for name, value, style in values]
    described = f"Spectrum of the residual of {spectrum.channel}: " + ", ".join(
        f"{name} up to {np.max(value):.2g} times white" for name, value, _ in curves
    )
    return figure(
        f"{spectrum.channel}: power of the residual over white",
        drawn,
        across,
        upward,
        (x_labels, y_labels),
        "frequency [Hz]",
        described,
        0.0,
    )


def correlation(spectrum: Spectrum) -> str:
    """Autocorrelation over lag, with the band in which those of white residuals lie."""
    own = versions(spectrum.correlation_before, spectrum.correlation_after)
    curves = [Curve(name, spectrum.lag_s, value, style) for name, value, style in own]
    ends = spectrum.lag_s[[0, -1]]
    for sign, silent in ((1.0, False), (-1.0, True)):
        curves.append(Curve("95 % of white", ends, np.full(2, sign * spectrum.band), "limit", silent=silent))
    across = Axis(0.0, float(ends[1]) * 1.02)
    upward = around((c.value for c in curves), (-0.2, 0.2))
    labels = ([(t, number(t)) for t in across.ticks(6)], [(t, number(t)) for t in upward.ticks(5)])
    described = f"Autocorrelation of the residual of {spectrum.channel}: largest " + ", ".join(
        f"{_largest(value):.2f} {name}" for name, value, _ in own
    )
    return figure(
        f"{spectrum.channel}: autocorrelation of the residual",
        curves,
        across,
        upward,
        labels,
        "lag [s]",
        described,
        0.0,
    )


def _largest(values: Array) -> float:
    return float(values[np.argmax(np.abs(values))])


def _raised(power: int) -> str:
    return f"{power}".translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
