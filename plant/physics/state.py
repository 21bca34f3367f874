"""Layout of the plant's state, command and output vectors: named indices, nothing else.

Bodies and joints share one numbering; joint j moves body j against its parent.
"""

from typing import Final

# Bodies, parents before children: the solver walks the tree by index. Their joints: articulation (z), oscillation (x), spin (y), lift (-y),
# tilt (-y).
REAR_FRAME: Final = 0
FRONT_FRAME: Final = 1
REAR_AXLE: Final = 2
WHEEL: Final = 3  # four: FL, FR, RL, RR
LIFT_ARM: Final = 7
BUCKET: Final = 8
BODIES: Final = 9
PARENTS: Final = (-1, 0, 0, 1, 1, 2, 2, 1, 7)

# State. Positions, then velocities, then forces that lag.
POSITION: Final = 0  # articulation joint in the world [m]
ATTITUDE: Final = 3  # unit quaternion w, x, y, z: world from rear frame
JOINT: Final = 6  # + body: joint angle [rad]; of the bucket: against the front frame, not the arm
VELOCITY: Final = 15  # of the articulation joint, world axes [m/s]
ANGULAR: Final = 18  # of the rear frame, its own axes [rad/s]
JOINT_RATE: Final = 20  # + body [rad/s]
KAPPA: Final = 29  # four: transient longitudinal slip
TAN_ALPHA: Final = 33  # four: transient tan of the slip angle, positive when the force is
DRIVE: Final = 37  # four: motor torque at the wheel [N m]
BRAKE: Final = 41  # four: available friction torque [N m]
STICK: Final = 45  # four: 0 wheel locked by its brake, +-1 direction in which the brake slips
SHAFT: Final = 49  # wind-up of the propeller shaft, seen at the wheels, front ahead positive [rad]
EXTRA: Final = 50  # states of the effects that are switched on
EXTRAS: Final = 64
STATES: Final = EXTRA + EXTRAS

# Commands.
C_DRIVE: Final = 0  # four
C_BRAKE: Final = 4  # four
C_ARTICULATION_RATE: Final = 8
C_LIFT_RATE: Final = 9
C_TILT_RATE: Final = 10
COMMANDS: Final = 11

# What one tyre reports.
T_NORMAL: Final = 0  # normal force [N]
T_LONGITUDINAL: Final = 1  # [N]
T_LATERAL: Final = 2  # [N]
T_ALIGNING: Final = 3  # [N m]
T_SLIP: Final = 4
T_SIDE_SLIP: Final = 5  # tangent of ISO 8855's slip angle
T_DEFLECTION: Final = 6  # [m]
T_KAPPA_RATE: Final = 7  # [1/s]
T_TAN_ALPHA_RATE: Final = 8  # [1/s]
T_WRENCH: Final = 9  # six: moment about the origin, force; axes of the caller
T_ROLLING_RADIUS: Final = 15  # effective [m]
T_SLIDING_X: Final = 16  # sliding velocity of the contact patch along the wheel [m/s]
T_SLIDING_Y: Final = 17  # and across it [m/s]
T_OUTPUTS: Final = 18

# Changes of the ground under a wheel by effects.
G_HEIGHT: Final = 0  # above the plane of the road [m]
G_RISE: Final = 1  # how fast it rises under the wheel [m/s]
G_FRICTION: Final = 2  # friction over that of the road
G_SLOPE: Final = 3  # of the height, along the world's x axis
GROUND: Final = 4
