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

# Rows of the state, (ROWS, WIDTH): what is kept of each signal ...
LAST, TREND, LEVEL, JUMPED, SAME, FAULTY, SINCE, MODE, EVER = range(9)
GAP: Final = 13  # cycles since the last sample
SIZE: Final = 17  # of the offset that explains the residuals
SUSPECTED: Final = 18  # time since a jump that others may still explain [s]; 0: none
LARGEST: Final = 19  # jump of those that wait for others to explain them
THRESHOLD: Final = 20  # of a jump, at present
# ... of each residual: sum of the sequential test up and down, and whether it has fired ...
UP, DOWN, FIRED = 9, 10, 11
MEAN, SPOILED = 14, 15  # its mean, time until it means something again
WAITING: Final = 16  # for other tests, in the first column
PAUSED: Final = 21  # time until a residual's filters have forgotten what its equation does not hold for [s]
# ... and of each message: how much its signals were stirred lately, in onsets.
STIR: Final = 22
# Filters of the residuals.
FILTERS: Final = 12
F_ANGLE, F_ROLL, F_PITCH, F_SPEED, F_ACCELERATION, F_ALONG, F_ACROSS, F_CYCLES, F_COUPLE, F_WARM, F_UP = (
    range(11)
)
F_TURNED, F_ROLLED, F_PITCHED, F_YAWED = 11, 12, 13, 14  # what the rates add to the observers' angles
F_DRAG: Final = 15  # force that slows the machine and that neither torques nor mass explain
F_SLOW_YAW, F_SLOW_ROLL = 16, 17  # slow means of rates, for their derivatives
F_PITCH_LEAN, F_ROLL_LEAN = 20, 21  # what accelerations will add to the slope's next sample
F_PITCH_TAKEN, F_ROLL_TAKEN = 22, 23  # what was taken off this one
F_LAST_SPEED, F_LAST_YAW = 24, 25  # of the cycle before, for that correction
F_PITCH_SWING, F_ROLL_SWING = 26, 27  # what the sensor's accelerometers add to the slope beside driving [rad]
F_PITCH_MISSED, F_ROLL_MISSED = 28, 29  # what an observer of the angle lacks of the lasting share of that
F_PITCH_OFFSET, F_ROLL_OFFSET = 30, 31  # its mean, that of sensors' offsets
F_PLACE, F_DUG = 18, 19  # of the payload in the bucket [m]; whether it is to be learned
# Filters of the motion: quick means of what changes, then how far it was from them lately.
MOTION: Final = 23
JOINT, ROLLING_RATE, PITCHING, YAWING, SPEED, GRIPPING, AHEAD, ASIDE, UPRIGHT, LIFTING, TILTING, LINES = (
    range(12)
)
QUICKS: Final = 12
PEAKS: Final = 24
# Torques whose changes are compared: of now, and one and two memories ago.
PRESENT, RECENT, EARLIER = 25, 26, 27
C_TORQUE: Final = 0  # mean, of four wheels
C_BOUND: Final = 4  # without the offsets of sound sensors, of two axles
C_TIME: Final = 6  # since the newest memory
RAMP: Final = 28  # of each signal: how far it has left its trend while a jump waits to be explained
ROWS: Final = 29
WIDTH: Final = max(COUNT, RESIDUALS, 32)

# Rows of the rules, (RULES, WIDTH), by signal: see `ecu.detection.rules`.
JUMP, FREEZE = 0, 1
# ... and by residual: noise, and how far the sequential test goes.
NOISE, TOLERANCE = 2, 3
CYCLES: Final = 4  # between two samples of a signal
ONSET: Final = 5  # innovation of a signal when the machine sets in
STIRRED: Final = 6  # innovation from which on noise does not explain it
RULES: Final = 7

# What a signal's fault was found by.
SOUND, BY_JUMP, BY_FREEZE, BY_RESIDUAL, UNDECIDED = range(5)

# What came of a signal in a cycle.
NO_SAMPLE, SAMPLE, REJECTED = (
    0,
    1,
    2,
)  # rejected: too far from the last one for another check; the next one is judged
