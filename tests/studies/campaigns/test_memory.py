"""Frames of a run decode alike, whether somebody has looked at them or not."""

import numpy as np

from bus.rows import Frames
from dbc import loader_database
from dbc.packing import Packer
from plant.unit.signals import MACHINE_MESSAGES
from studies.campaigns.memory import columns_of, table_of


def test_rows_decode_as_frames_do():
    codecs = [(loader_database().by_name[name], MACHINE_MESSAGES[name]) for name in MACHINE_MESSAGES]
    packer = Packer(codecs)
    values = np.random.default_rng(1).normal(0.0, 1.0, (30, len(packer.sources)))
    plans = [packer.plan([k % len(codecs), (k + 3) % len(codecs)]) for k in range(30)]
    rows = packer.pack_many(plans, values, [10**7 * k for k in range(30)])
    kept, looked_at = Frames(), Frames()
    for frames in (kept, looked_at):
        frames.add(rows[:20])
        frames.add(rows[20:])
    assert len(list(looked_at)) == 60
    ours, theirs = table_of(kept), table_of(looked_at)
    for name in ("time_ns", "can_id", "length", "flags", "data", "channel"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert kept.parts()[0] == []
    found, expected = columns_of(kept), columns_of(looked_at)
    assert found.keys() == expected.keys() == set(MACHINE_MESSAGES)
    for name, columns in expected.items():
        np.testing.assert_array_equal(found[name].time_s, columns.time_s)
