"""The collector is off for a block, and as before after it, however the block ends."""

import gc

import pytest

from hil.shell.collector import uncollected


def broken() -> None:
    with uncollected():
        assert not gc.isenabled()
        raise ImportError("broken")


@pytest.mark.parametrize("before", [True, False])
def test_it_is_as_before_after_a_block_that_fails(before: bool) -> None:
    (gc.enable if before else gc.disable)()
    try:
        with pytest.raises(ImportError):
            broken()
        assert gc.isenabled() is before
    finally:
        gc.enable()


def test_what_is_kept_is_searched_no_more() -> None:
    frozen = gc.get_freeze_count()
    try:
        with uncollected(kept=True):
            made = [[number] for number in range(1000)]
        assert gc.get_freeze_count() >= frozen + len(made)
    finally:
        gc.unfreeze()
