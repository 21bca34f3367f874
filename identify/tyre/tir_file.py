"""A tyre property file (.tir) of an identified tyre, in the words that the plant and tyre software read."""

from collections.abc import Mapping

from identify.tyre.parameters import COMBINED, MEANINGS, NAMES, Nominal


def tir_text(
    values: Mapping[str, float],
    nominal: Nominal,
    *,
    vertical_stiffness: float,
    notes: Mapping[str, str],
    comments: tuple[str, ...] = (),
) -> str:
    """The text of a .tir file, MF-Tyre 6.1, longitudinal part.

    values: parameters by name; vertical_stiffness: [N/m]; notes: what is said of each behind its value; comments: lines of its head.
    Lateral parameters are not in it: a rig for longitudinal slip does not measure them.
    """
    lines = [
        "[MDI_HEADER]", "FILE_TYPE = 'tir'", "FILE_VERSION = 3.0", *(f"! {line}" for line in comments), "",
        "[UNITS]", "LENGTH = 'meter'", "FORCE = 'newton'", "ANGLE = 'radians'", "MASS = 'kg'", "TIME = 'second'", "",
        "[MODEL]", "FITTYP = 61 $Magic Formula version", "",
        "[DIMENSION]", f"UNLOADED_RADIUS = {nominal.radius!r} $Free tyre radius", "",
        "[OPERATING_CONDITIONS]", f"NOMPRES = {nominal.pressure!r} $Nominal inflation pressure", "",
        "[VERTICAL]", f"FNOMIN = {nominal.load!r} $Nominal wheel load", f"VERTICAL_STIFFNESS = {vertical_stiffness!r} $Tyre vertical stiffness", "",
        "[LONGITUDINAL_COEFFICIENTS]",
    ]  # fmt: skip
    lines += [
        f"{name} = {float(values[name])!r} ${notes.get(name, MEANINGS[name])}"
        for name in (*NAMES, *COMBINED)
        if name in values
    ]
    return "\n".join([*lines, ""])
