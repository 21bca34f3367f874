"""Where the processes of a run meet."""

import pytest

from hil.gateway.buses import ONE_BUS, Buses, BusesError


def test_without_a_gateway_both_are_on_one_hub(tmp_path):
    addresses = ONE_BUS.addresses(tmp_path)
    assert addresses["plant"] == addresses["ecu"] == f"hub:{tmp_path / 'hub'}"
    assert ONE_BUS.own_hubs(tmp_path) == {"hub": addresses["plant"]}


def test_with_a_gateway_each_side_has_its_own(tmp_path):
    buses = Buses(gateway=True)
    addresses = buses.addresses(tmp_path)
    assert addresses["plant"] != addresses["ecu"]
    assert set(buses.own_hubs(tmp_path).values()) == set(addresses.values())


def test_a_bus_that_is_there_already_needs_no_hub(tmp_path):
    buses = Buses(gateway=True, ecu="socketcan:can0")
    assert buses.addresses(tmp_path)["ecu"] == "socketcan:can0"
    assert list(buses.own_hubs(tmp_path)) == ["plant-hub"]


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"plant": "socketcan:can0"}, "--plant-bus"),
        ({"ecu": "socketcan:can0"}, "--ecu-bus"),
        ({"gateway": True, "plant": "hub:a", "ecu": "hub:a"}, "both hub:a"),
        ({"foreign_ecu": "can0"}, "--ecu: 'can0' is no address of a bus; write socketcan:can0"),
        ({"foreign_plant": "usb:1"}, "--plant: 'usb:1': there is no kind of bus 'usb'"),
        ({"gateway": True, "ecu": "hub:"}, "--ecu-bus: 'hub:' is no address"),
    ],
)
def test_what_does_not_go_together_is_reported(chosen, message):
    with pytest.raises(BusesError, match=message):
        Buses(**chosen)
