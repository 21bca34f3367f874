"""Which effects lanes can do."""

from types import SimpleNamespace

from plant.effects.registry import modules
from plant.lanes.kernels import unreadable
from plant.physics.state import G_HEIGHT


def before_tyre(q, x, state, p, wheel, work):
    """Ground that a search finds: how often the search goes on differs between machines."""
    height = q[0]
    while height > 0.1:
        height *= 0.5
    work.ground[wheel, G_HEIGHT] += height


def joints(q, x, state, p, work):
    """Nothing that lanes could not do."""
    work.tree.effort[2] += q[0] * state[x]


def test_every_effect_of_the_library_can_be_done_in_lanes():
    assert unreadable(modules()) == []


def test_an_effect_with_a_search_is_computed_alone():
    own = SimpleNamespace(before_tyre=before_tyre, joints=joints)
    assert unreadable({"own": own}) == [before_tyre]
