"""What is loaded is not looked through again and again for garbage, and the collector works afterwards."""

import gc

import pytest

from loaderhil.loading import uncollected


def test_nothing_is_collected_meanwhile_and_what_was_made_is_left_alone_afterwards():
    frozen = gc.get_freeze_count()
    try:
        with uncollected():
            assert not gc.isenabled()
            kept = [[number] for number in range(1000)]
        assert gc.isenabled()
        assert gc.get_freeze_count() >= frozen + len(kept)
    finally:
        gc.unfreeze()


def test_the_collector_works_again_after_a_module_that_is_broken():
    try:
        with pytest.raises(ImportError), uncollected():
            raise ImportError("broken")
        assert gc.isenabled()
    finally:
        gc.unfreeze()
