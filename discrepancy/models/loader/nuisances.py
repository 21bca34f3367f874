"""Nuisances of the loader's model: what the machine's sheet, its sensors and a segment's initial state leave uncertain."""

from typing import Final

from discrepancy.model.description import Parameter
from discrepancy.models.loader.channels import CHANNELS, TORQUE_SCALE_SD

BOUNCE: Final = (
    12.0  # natural frequency of the loader on its tyres [rad/s]; relates the priors of positions and rates
)
HEAVE_M: Final = 2e-3  # about 1 kN per wheel
TILT_RAD: Final = 2e-3  # about the same at a wheel, 1 m from the middle
SPEED_M_S: Final = 0.05  # the replay's feedback leaves a quarter of it where scoring begins


def zero(channel: str) -> str:
    """Name of the nuisance that is a channel's zero point."""
    return f"zero.{channel}"


def scale(channel: str) -> str:
    """Name of the nuisance that is a channel's scale error."""
    return f"scale.{channel}"


def _initial(name: str, unit: str, sd: float) -> Parameter:
    return Parameter(name=f"initial.{name}", unit=unit, typical=sd, prior_sd=sd, scope="initial_uncertainty")


# After a hard stop the machine swings on its soft tyres for seconds, and the warm-up run reproduces that swing only about.
# Lateral motion and the joints' motion are damped within the lead-in, so that their initial errors need no parameter.
INITIAL_STATES = (
    _initial("height", "m", HEAVE_M),
    _initial("height_rate", "m/s", HEAVE_M * BOUNCE),
    _initial("roll", "rad", TILT_RAD),
    _initial("pitch", "rad", TILT_RAD),
    _initial("roll_rate", "rad/s", TILT_RAD * BOUNCE),
    _initial("pitch_rate", "rad/s", TILT_RAD * BOUNCE),
    _initial("speed", "m/s", SPEED_M_S),
)
"""Initial-state uncertainty of a segment: differences from the warm-up run that no sensor measures exactly."""

# The torques of a segment are those of the pedals with an offset and a factor from the torque sensors. Their noise leaves both uncertain, by
# the same amount in the whole segment: without this, a resistance that differs a little from one segment to the next was taken for certain.
TORQUE_ERRORS = (_initial("torque_offset", "1", 1.0), _initial("torque_factor", "1", 1.0))
"""Errors of a segment's torques in standard deviations (`replay_inputs.torque_errors`). No initial states, but as uncertain as these in every segment."""

# The height of the front frame's centre, and inertias, are no nuisances of a diagnosis: they are effects of its library, or no drive shows
# them. An identification of the machine frees them. A sheet estimates them: centres to 5 cm, inertias to 30 %, and that of a wheel, which
# follows from the mass of tyre and rim, to 15 %.
BODIES = (
    Parameter(name="front_height", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="lift_arm_pitch", unit="1", lower=-0.9, upper=9.0, typical=0.2, prior_sd=0.3),
    Parameter(name="wheel_spin", unit="1", lower=-0.9, upper=4.0, typical=0.1, prior_sd=0.15),
    *(
        Parameter(name=f"{end}_{axis}_inertia", unit="1", lower=-0.8, upper=3.0, typical=0.15, prior_sd=0.3)
        for axis in ("yaw", "pitch", "roll")
        for end in ("rear", "front")
    ),
)
"""Values of the machine's bodies that only an identification frees: the front frame's height, shares of inertia of frames, lift arm and wheels.

The shares are of the bodies of the sheet. The effects yaw_inertia and roll_inertia act on the whole front part, with its axle.
"""

# Priors are about the accuracy with which a sheet or a workshop knows a value: masses to 2 %, a centre of gravity to 5 cm, tyres to 5 %
# radially and to 10 % along and across (a maker gives a load over a deflection, and the rest comes from a tyre of its class), torque to 2 %,
# angle sensors to a few mrad.
NUISANCES = (
    Parameter(name="rear_mass", unit="kg", lower=-1500.0, upper=1500.0, typical=100.0, prior_sd=120.0),
    Parameter(name="front_mass", unit="kg", lower=-800.0, upper=800.0, typical=50.0, prior_sd=60.0),
    Parameter(name="rear_x", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="front_x", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="rear_height", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="tyre_stiffness", unit="1", lower=-0.5, upper=1.0, typical=0.05, prior_sd=0.05),
    Parameter(name="slip_stiffness", unit="1", lower=-0.6, upper=2.0, typical=0.05, prior_sd=0.1),
    Parameter(name="cornering_stiffness", unit="1", lower=-0.6, upper=2.0, typical=0.05, prior_sd=0.1),
    Parameter(
        name="torque_scale",
        unit="1",
        lower=-0.2,
        upper=0.2,
        typical=TORQUE_SCALE_SD,
        prior_sd=TORQUE_SCALE_SD,
    ),
    Parameter(name="articulation_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.003, prior_sd=0.004),
    Parameter(name="lift_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.004, prior_sd=0.005),
    Parameter(name="tilt_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.004, prior_sd=0.005),
    Parameter(name="wheel_radius", unit="m", lower=-0.03, upper=0.03, typical=0.002, prior_sd=0.002),
    *(
        Parameter(name=zero(name), unit=channel.unit, typical=channel.zero, prior_sd=channel.zero)
        for name, channel in CHANNELS.items()
        if channel.zero > 0.0
    ),
    *(
        Parameter(
            name=scale(name), unit="1", lower=-0.05, upper=0.05, typical=channel.scale, prior_sd=channel.scale
        )
        for name, channel in CHANNELS.items()
        if channel.scale > 0.0
    ),
    *INITIAL_STATES,
    *TORQUE_ERRORS,
)
