"""Places of what the detection keeps, is given and finds, in arrays of floats: small enough to compile in seconds."""

from typing import Final

from ecu.watched import COUNT

# Residuals, in the order of `ecu.detection.residuals`.
ANGLE_RATE: Final = 0  # articulation angle against its rate
ROLL_GYRO, PITCH_GYRO = 1, 2  # slope sensor against gyro
PITCH_RATES: Final = 3  # slope sensor's pitch rate against the gyro's
SPEEDS: Final = 4  # six pairs of wheels: 12, 13, 14, 23, 24, 34
YAW_STEERING: Final = 10  # yaw rate against articulation and speed
ALONG, ACROSS, UPWARDS = 11, 12, 13  # acceleration against wheels, slope, yaw rate
FRONT_TORQUES, REAR_TORQUES = 14, 15  # left against right
TRACTION: Final = 16  # torques against acceleration and mass
BUCKET_LOAD: Final = 17  # tilt pressure against lift pressure: place of the payload
STEERING_LINES: Final = 18  # the line that does not push
RESIDUALS: Final = 19

# Rows of the state, (ROWS, COUNT): what is kept of each signal ...
LAST, TREND, LEVEL, JUMPED, SAME, FAULTY, SINCE, MODE, EVER = range(9)
GAP: Final = 13  # cycles since the last sample
MEAN, SPOILED, WAITING = (
    14,
    15,
    16,
)  # of each residual: its mean, time until it means something again; waiting for others
# ... and of each residual: sum of the sequential test up and down, and whether it has fired.
UP, DOWN, FIRED = 9, 10, 11
# Filters of the residuals.
FILTERS: Final = 12
F_ANGLE, F_ROLL, F_PITCH, F_SPEED, F_ACCELERATION, F_ALONG, F_ACROSS, F_CYCLES, F_COUPLE, F_WARM, F_UP = (
    range(11)
)
SIZE: Final = 17  # of the offset that explains the residuals
ROWS: Final = 18
WIDTH: Final = max(COUNT, RESIDUALS, 11)

# Rows of the rules, (RULES, COUNT), by signal: see `ecu.detection.rules`.
JUMP, FREEZE = 0, 1
# ... and by residual: noise, and how far the sequential test goes.
NOISE, TOLERANCE = 2, 3
CYCLES: Final = 4  # between two samples of a signal
RULES: Final = 5

# What a signal's fault was found by.
SOUND, BY_JUMP, BY_FREEZE, BY_RESIDUAL, UNDECIDED = range(5)

# What came of a signal in a cycle.
NO_SAMPLE, SAMPLE, REJECTED = (
    0,
    1,
    2,
)  # rejected: too far from the last one for another check; the next one is judged
