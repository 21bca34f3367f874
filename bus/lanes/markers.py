"""What the text of a function may call beside Python's own: it means the same where Python runs the text."""


def to_whole(x: float) -> float:
    """The nearest whole number; half-way cases go to the even one."""
    return float(round(x))


def power_of_two(exponent: float) -> float:
    """2 to the power of a whole number."""
    return float(2.0**exponent)
