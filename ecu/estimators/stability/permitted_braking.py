"""How hard a speed limit may brake: so that the machine keeps its margins while it brakes.

A limit that is far below the speed takes the drive torque away, then brakes. Uphill the loss of torque alone slows the machine down.
Deceleration loads the front axle, which carries the whole roll-over moment: in a bend on a slope it lifts the wheel that the limit is
to keep down. ISO 8855, rear frame axes.
"""

from ecu.estimators.compiled import compiled
from ecu.estimators.stability.permitted import NONE
from ecu.estimators.stability.prediction import predict, with_acceleration
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.step import PredictionState

HARDEST = 3.0
"""A limit brakes no harder than so many times `braking`, the deceleration that is relied on."""
GENTLE = 0.25
"""Share of the deceleration that is asked for which is tried in its place. One other trial: each costs a controller half a millisecond."""


@compiled
def permitted_deceleration(start: PredictionState, asked: float, machine: LoadedMachine) -> float:
    """The deceleration `asked` for [m/s2] if it keeps `margin_floor`, else a quarter of it if that leaves more."""
    rules = machine.prediction
    forward = 1.0 if start.speed >= 0.0 else -1.0
    hard = predict(with_acceleration(start, -forward * asked), rules.limit_hold, NONE, machine).margin
    if hard > rules.margin_floor:
        return asked
    less = GENTLE * asked
    # a prediction ends where it is no better than the other
    soft = predict(with_acceleration(start, -forward * less), rules.limit_hold, hard, machine).margin
    return less if soft > hard else asked


@compiled
def gentle(limit: float, start: PredictionState, machine: LoadedMachine) -> float:
    """The speed limit [m/s], raised so far that it brakes no harder than permitted.

    A machine that is above its limit brakes in proportion; uphill, one that is at its limit slows down by its weight.
    """
    rules = machine.prediction
    speed, forward = abs(start.speed), 1.0 if start.speed >= 0.0 else -1.0
    uphill = forward * start.ground.x
    asked = min((speed - limit) / rules.braking_slack + uphill, HARDEST * rules.braking)
    if asked <= 0.0:
        return limit
    permitted = permitted_deceleration(start, asked, machine)
    if permitted >= asked:
        return limit
    return max(limit, min(speed - rules.braking_slack * (permitted - uphill), rules.largest_speed))
