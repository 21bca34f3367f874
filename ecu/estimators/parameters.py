"""What the estimators know of the machine: named tuples of floats, SI, ISO 8855.

Positions are measured from the articulation joint on the ground, x forward and z up, in the axes of
the frame (front or rear) the part belongs to. `ecu.calibration` reads them from a file.
"""

from typing import NamedTuple

GRAVITY = 9.81  # as in the thesis [m/s2]


class Geometry(NamedTuple):
    """Wheels, joint and pivot."""

    front_length: float  # l_f, joint to front axle [m]
    rear_length: float  # l_r, joint to rear axle [m]
    front_track: float  # t [m]
    rear_track: float  # t_r [m]
    pivot_height: float  # h_R, oscillation pivot of the rear axle above ground [m]
    articulation_stop: float  # largest magnitude of the articulation angle [rad]


class Body(NamedTuple):
    """A rigid lump in the plane of symmetry of its frame; moments of inertia about its own CoG."""

    mass: float  # [kg]
    x: float  # [m]
    z: float  # [m]
    roll_inertia: float  # about x [kg m2]
    pitch_inertia: float  # about y [kg m2]
    yaw_inertia: float  # about z [kg m2]


class Arm(NamedTuple):
    """Lift arm and linkage: a lump that turns about a pivot of the front frame."""

    pivot_x: float  # [m]
    pivot_z: float  # [m]
    length: float  # pivot to bucket pin [m]
    mass: float  # [kg]
    along: float  # CoG along the arm from the pivot [m]
    above: float  # CoG above the arm [m]
    roll_inertia: float
    pitch_inertia: float
    yaw_inertia: float


class Bucket(NamedTuple):
    """Bucket and payload: offsets from the bucket pin, in front axes, at the tilt angle `carried`."""

    mass: float  # [kg]
    carried: float  # tilt angle at which the offsets hold [rad]
    forward: float  # CoG of the bucket ahead of the pin [m]
    above: float  # ... and above it [m]
    payload_forward: float  # CoG of the payload ahead of the pin [m]
    payload_above: float
    roll_inertia: float
    pitch_inertia: float
    yaw_inertia: float
    payload_roll_gyration: float  # radius of gyration of the payload about x [m]
    payload_pitch_gyration: float
    payload_yaw_gyration: float


class Cylinders(NamedTuple):
    """Lift cylinders: base on the front frame, rod pin on the arm; areas of all cylinders together."""

    base_x: float  # [m]
    base_z: float  # [m]
    pin_along: float  # along the arm from the arm's pivot [m]
    pin_above: float  # [m]
    head_area: float  # [m2]
    rod_area: float  # of the rod side [m2]
    back_pressure: float  # on the rod side [Pa]
    settling_time: float  # time constant of the payload filter [s]


class TiltLinkage(NamedTuple):
    """Tilt cylinder on the front frame, bell crank on the arm, link to the bucket; areas of all cylinders together."""

    base_x: float  # [m]
    base_z: float
    crank_along: float  # pivot of the crank, along the arm from the arm's pivot [m]
    crank_above: float
    cylinder_arm: float  # of the crank, to the cylinder [m]
    link_arm: float  # of the crank, to the link [m]
    between: float  # angle from the link's arm to the cylinder's, upwards [rad]
    link: float  # length of the link [m]
    pin_forward: float  # link on the bucket, from the bucket's pin as carried [m]
    pin_above: float
    head_area: float  # [m2]
    rod_area: float
    back_pressure: float  # [Pa]


class Digging(NamedTuple):
    """The cutting edge, and when the machine is in a pile."""

    edge_forward: float  # ahead of the bucket's pin, as carried [m]
    edge_above: float
    force: float  # on the edge, and of traction nothing else explains, from which on it digs [N]
    speed: float  # above which it does not begin to [m/s]
    settling_time: float  # of the force's filter [s]


class Axle(NamedTuple):
    """Oscillating rear axle with its wheels."""

    mass: float  # m_a [kg]
    height: float  # h_a [m]
    roll_inertia: float  # [kg m2]


class Wheel(NamedTuple):
    """Wheel and tyre, the same at all four corners."""

    unloaded_radius: float  # R0 [m]
    nominal_load: float  # F_zo [N]
    radial_linear: float  # q_Fz1 of (118)
    radial_quadratic: float  # q_Fz2 of (118)
    front_stiffening: float  # factor on (118) by the inflation pressure of the front tyres
    rear_stiffening: float  # ... of the rear tyres
    front_pressure: float  # inflation pressure [Pa]
    rear_pressure: float
    spin_inertia: float  # J_w [kg m2]
    rolling_resistance: float  # f_r, moment over load and radius
    slip_stiffness: float  # C_Fkappa over normal force
    cornering_stiffness: float  # C_Falpha over normal force, at the nominal load [1/rad]
    cornering_load: float  # load at which the cornering stiffness is largest, over the nominal load
    lateral_peak: float  # peak lateral friction
    friction: float  # longitudinal friction for torque and slip warnings
    pneumatic_trail: float  # t_p [m]
    longitudinal_relaxation: float  # sigma_kappa [m]
    low_speed: float  # V_low: slip is taken against at least this speed [m/s]


class MagicFormula(NamedTuple):
    """Longitudinal Magic Formula with load and pressure dependence, equations (11)-(24)."""

    nominal_load: float  # F_zo [N]
    nominal_pressure: float  # p_io [Pa]
    PCx1: float
    PDx1: float
    PDx2: float
    PEx1: float
    PEx2: float
    PEx3: float
    PEx4: float
    PKx1: float
    PKx2: float
    PKx3: float
    PHx1: float
    PHx2: float
    PVx1: float
    PVx2: float
    Ppx1: float
    Ppx2: float
    Ppx3: float
    Ppx4: float


class Sensors(NamedTuple):
    """Where the inertial sensor sits (rear frame), and how fast derivatives of signals follow."""

    imu_x: float  # [m]
    imu_y: float
    imu_z: float
    rate_time: float  # time constant of angular accelerations from the gyro and the articulation rate [s]
    wheel_time: float  # time constant of wheel accelerations [s]
    speed_gain: float  # share of the wheels' innovation taken over per second [1/s]
    speed_scatter: float  # innovation at which a wheel's influence starts to fall [m/s]
    speed_scatter_slope: float  # ... plus this share of the speed
    slope_levelling: (
        float  # time constant with which accelerometers correct the inclination sensor's gyro [s]
    )


class Contact(NamedTuple):
    """How the loads follow the gyro and the balance of forces."""

    # time constant of the tilt [s]: faster changes come from the gyro, slower ones from the balance of forces; 0: balance alone
    settling_time: float
    bias_time: float  # time constant with which the gyro's bias is learnt [s]
    latency: float  # age of a gyro sample when the estimate arrives [s]
    damping: float  # of a tyre, radial [N s/m]


class PredictionRules(NamedTuple):
    """Feed-forward prediction of lift-off."""

    horizon: float  # [s]
    step: float  # [s]
    steering_lag: float  # articulation rate follows its demand with this time constant [s]
    steering_acceleration: float  # ... and changes no faster than this [rad/s2]
    cushion: float  # before its stop the articulation slows down with this time constant [s]
    acceleration_memory: float  # present longitudinal acceleration fades with this time constant [s]
    demand_hold: float  # the demanded rate is assumed to last this long [s]
    limit_hold: float  # a permitted rate has to be safe if it lasts this long [s]
    turn_ahead: float  # headings this far ahead have to be safe, at the speed that is left there [s]
    turn_floor: float  # ... with this margin for a rate to be permitted
    braking: float  # deceleration that a falling speed limit is relied on to bring on level ground [m/s2]
    braking_slack: float  # how far above its limit the machine has to be, per deceleration [s]
    tyre_stiffness: float  # k_z of a front tyre [N/m]
    roll_damping: float  # damping ratio of the tyres at the pitch frequency
    margin_floor: float  # the articulation rate is limited so that the predicted margin stays above
    speed_floor: float  # the speed is limited so that the standing turn keeps this margin
    largest_rate: float  # articulation rate of the unlimited machine [rad/s]
    largest_speed: float  # speed of the unlimited machine [m/s]


class LinkageDrive(NamedTuple):
    """How fast and how far lift arm and bucket are driven; angles above the front frame's horizontal."""

    lift_up: float  # rate at a full lever [rad/s]
    lift_down: float
    tilt_back: float
    tilt_forward: float
    lag: float  # a rate follows its demand with this time constant [s]
    cushion: float  # before the end of its stroke a part slows down with this time constant [s]
    lift_low: float  # ends of the strokes [rad]
    lift_high: float
    tilt_low: float
    tilt_high: float


class Parameters(NamedTuple):
    """Everything the estimators know of one machine."""

    geometry: Geometry
    front: Body  # front frame with its axle and wheels, without arm and bucket
    arm: Arm
    bucket: Bucket
    rear: Body  # rear frame without the rear axle
    axle: Axle
    cylinders: Cylinders
    tilt_linkage: TiltLinkage
    digging: Digging
    linkage_drive: LinkageDrive
    wheel: Wheel
    magic_formula: MagicFormula
    sensors: Sensors
    contact: Contact
    prediction: PredictionRules
