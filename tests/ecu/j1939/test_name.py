"""The NAME of J1939-81, against can-j1939, which knows only the standard."""

import j1939
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.j1939.name import EXAMPLE, BadName, Name

BITS = {
    "identity": 21, "manufacturer": 11, "ecu_instance": 3, "function_instance": 5, "function": 8,
    "vehicle_system": 7, "vehicle_system_instance": 4, "industry": 3,
}  # fmt: skip
THEIRS = {"identity": "identity_number", "manufacturer": "manufacturer_code", "industry": "industry_group"}


@given(st.fixed_dictionaries({name: st.integers(0, (1 << bits) - 1) for name, bits in BITS.items()}))
def test_every_field_has_its_place(values):
    theirs = j1939.Name(
        arbitrary_address_capable=0, **{THEIRS.get(name, name): value for name, value in values.items()}
    )
    assert int(Name(**values)) == theirs.value
    assert Name.parse(",".join(f"{name}={value:#x}" for name, value in values.items())) == Name(**values)


def test_what_is_not_given_is_not_available_in_a_construction_machine():
    name = Name.parse(EXAMPLE)
    assert (name.identity, name.manufacturer) == (1, 0)
    assert (name.function, name.vehicle_system, name.industry) == (0xFF, 0x7F, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("identity=1", "needs manufacturer, as in"),
        ("", "no field ''"),
        ("identity=1,manufacturer=2048", "manufacturer is 2048 and may be 0 to 2047"),
        ("identity=-1,manufacturer=0", "identity is -1"),
        ("identity=one,manufacturer=0", "identity is no whole number: 'one'"),
        ("maker=1", "no field 'maker'; it has identity, manufacturer"),
    ],
)
def test_a_wrong_name_is_explained(text, message):
    with pytest.raises(BadName, match=message):
        Name.parse(text)
