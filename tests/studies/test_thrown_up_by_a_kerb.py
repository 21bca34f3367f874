"""A full raised bucket over a kerb: while the load hardly weighs, the ECU keeps its mass (ADR 88)."""

from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.memory import columns_of
from studies.campaigns.prevention import driven

KERB = Manoeuvre(
    kind="kerb",
    speed_kmh=10.9,
    payload_kg=3204,
    arm_deg=45.5,
    angle_deg=-37.7,
    rate_deg_s=19.1,
    seed=798217629,
    left_m=0.164,
)
LAST_BY_THE_KERB_S = 2.7


def test_the_bounce_after_a_kerb_does_not_empty_the_bucket():
    """The payload fell to -8 t, the joint was let go, and both rear wheels lifted at 3.3 s."""
    _, recording = driven(KERB, limits=True)
    late = [min(row.normal_force) for row in recording.truth if row.time_s > LAST_BY_THE_KERB_S]
    assert min(late) > 0.0
    payload = columns_of(recording.bus)["BodyMotion"].signals["PayloadMass"][1:]
    assert payload.min() > 2000.0
