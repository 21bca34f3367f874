"""udsoncan on the ECU's UDS service, over can-isotp, in one process."""

import contextlib
from collections.abc import Iterator

import can
import isotp
import udsoncan
from udsoncan.client import Client
from udsoncan.connections import PythonIsoTpConnection

from bus.frame import EXTENDED_MASK
from dbc import loader_database
from ecu.calibration import calibration_table
from ecu.measure.access import DIAGNOSE, key_of
from ecu.measure.channel import Channel
from ecu.uds.service import uds_service
from tests.ecu.xcp.tool import SECRET, DirectBus, Ecu

CHANNEL = Channel.parse("0x18DA80F1,0x18DAF180", loader_database())


class UdsEcu(Ecu):
    """An ECU with UDS instead of XCP."""

    channel = CHANNEL

    def __init__(self, *, secret: bytes | None = SECRET, **options: bool) -> None:
        super().__init__(**options)
        seeds = iter(range(1, 1 << 16))
        self.service = uds_service(
            self.cycle, calibration_table(), CHANNEL,
            version="1.2.3", secret=secret, random=lambda n: next(seeds).to_bytes(n, "big"),
        )  # fmt: skip


class Text(udsoncan.DidCodec):
    """A text of any length, alone in its request."""

    def encode(self, value):
        return value.encode()

    def decode(self, payload):
        return payload.decode()

    def __len__(self):
        raise udsoncan.DidCodec.ReadAllRemainingData


def key_for(secret: bytes):
    def algorithm(level, seed, params):
        return key_of(secret, DIAGNOSE, bytes(seed))

    return algorithm


FLOAT = ">f"


@contextlib.contextmanager
def tool(ecu: Ecu, secret: bytes = SECRET) -> Iterator[Client]:
    """A udsoncan client that is connected to an ECU in this process."""
    with DirectBus(ecu) as bus, client_on(bus, secret) as client:
        yield client


@contextlib.contextmanager
def client_on(bus: can.BusABC, secret: bytes = SECRET) -> Iterator[Client]:
    """A udsoncan client on a bus."""
    address = isotp.Address(
        isotp.AddressingMode.Normal_29bits,
        rxid=CHANNEL.send & EXTENDED_MASK,
        txid=CHANNEL.receive & EXTENDED_MASK,
    )
    config = dict(udsoncan.configs.default_client_config) | {
        "security_algo": key_for(secret),
        "data_identifiers": {
            0xF190: Text, 0xF195: Text, 0xF1A0: Text, 0xF1A1: ">I",
            **{0x0100 + k: FLOAT for k in range(5)},
            **{0x1000 + k: FLOAT for k in range(40)},
        },
        "request_timeout": 20, "p2_timeout": 20, "p2_star_timeout": 20, "use_server_timing": False,
        "extended_data_size": 1,
    }  # fmt: skip
    stack = isotp.CanStack(bus=bus, address=address, params={"blocksize": 4, "stmin": 0})
    with Client(PythonIsoTpConnection(stack), config=config) as client:
        yield client
