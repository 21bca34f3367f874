"""No mutated file raises anything but the reader's own error, takes 10 s, or a gigabyte."""

import random

import pytest

from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS, fuzz

FEW = {"mf4": 20, "run folder": 40, "dbc": 40}
"""The slower readers; `make fuzz` reads 10^5 files."""


@pytest.mark.parametrize("name", READERS)
def test_mutated_files_end_in_one_line_or_are_read(name, tmp_path):
    outcome = fuzz(name, FEW.get(name, 100), tmp_path)
    assert outcome.defects == []


@pytest.mark.parametrize("name", READERS)
def test_the_corpus_itself_is_read(name, tmp_path):
    from tests.fuzz.readers import CORPUS

    for file in CORPUS.glob(f"*{READERS[name].suffix}"):
        READERS[name].read(file)


def test_a_number_always_gives_the_same_mutation():
    first, again = (mutated(b"seed of a file", [b"another"], random.Random("x/3")) for _ in range(2))
    assert first == again
    assert first != b"seed of a file"
