"""Any bytes give an object or a ValueError, never another error, in bounded time."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.bounded_json import DEPTH, printable, read_object


@given(
    st.dictionaries(
        st.text(), st.none() | st.booleans() | st.integers() | st.text() | st.lists(st.integers())
    )
)
def test_an_object_comes_back_as_it_was(message):
    assert read_object(json.dumps(message).encode(), 1 << 20) == message


@given(st.binary() | st.text(alphabet='[]{}"\\:,0e-\x00').map(str.encode))
def test_any_bytes_give_an_object_or_a_value_error(text):
    with contextlib.suppress(ValueError):
        assert isinstance(read_object(text, 1000), dict)


def test_depth_counts_brackets_outside_strings_only():
    inner = b"[" * (DEPTH - 1) + b"]" * (DEPTH - 1)
    assert read_object(b'{"a": ' + inner + b', "[[[[[[[[[[": "\\"[[[[[[[[[["}', 1000)
    with pytest.raises(ValueError, match="nested more than 8 deep"):
        read_object(b'{"a": [' + inner + b"]}", 1000)


def test_text_is_cut_and_cannot_steer_a_terminal():
    assert printable("a\x1b[2Jb\n\x9b\u202e") == "a\\x1b[2Jb\\n\\x9b\\u202e"
    assert printable("n" * 100, 10) == "nnnnnnn..."
    assert printable("Räder µ") == "Räder µ"
