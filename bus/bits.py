"""Duration of a frame on the wire, for the arbitration model: the exact bits are built, stuff bits included.

ISO 11898-1. A classic frame is stuffed from start of frame to the end of its CRC, so
the CRC has to be computed. A CAN FD frame is stuffed up to the end of its data; its CRC
field has stuff bits at fixed places, and the part from the bit-rate switch to the CRC
delimiter runs at the data bit rate.
"""

from bus.frame import BRS, ERROR, EXTENDED, EXTENDED_MASK, FD, REMOTE, STANDARD_MASK, Frame

CRC15 = 0xC599
"""Generator polynomial x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1."""
CLASSIC_TAIL = 13
"""CRC delimiter 1, acknowledge 2, end of frame 7, intermission 3."""
FD_TAIL = 12
"""As above after the CRC delimiter, which still belongs to the data phase."""
ERROR_BITS = 17
"""Error flag 6, error delimiter 8, intermission 3."""
_FD_CODES = {12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}
SECOND = 1_000_000_000


def duration_ns(frame: Frame, bit_rate: int, data_bit_rate: int | None = None) -> int:
    """How long the frame occupies the wire [ns]; rates in bit/s, the data rate counts for FD with BRS."""
    if frame.can_id & ERROR:
        return round(ERROR_BITS * SECOND / bit_rate)
    if not frame.flags & FD:
        return round((len(stuffed(classic_bits(frame))) + CLASSIC_TAIL) * SECOND / bit_rate)
    arbitration, data = fd_lengths(frame)
    # without the bit-rate switch a CAN FD frame stays at the nominal rate to its end
    fast = data_bit_rate if data_bit_rate and frame.flags & BRS else bit_rate
    return round(arbitration * SECOND / bit_rate + data * SECOND / fast)


def classic_bits(frame: Frame) -> str:
    """Start of frame to the end of the CRC, without stuff bits, as a text of 0 and 1."""
    remote = bool(frame.can_id & REMOTE)
    control = "00" if frame.can_id & EXTENDED else "0"  # reserved bits; IDE is part of the identifier here
    length = f"{len(frame.data):04b}"
    data = "" if remote else "".join(f"{byte:08b}" for byte in frame.data)
    bits = "0" + _identifier_bits(frame.can_id, "1" if remote else "0") + control + length + data
    return bits + f"{crc15(bits):015b}"


def _identifier_bits(can_id: int, last: str) -> str:
    """Arbitration field and IDE; `last` is the RTR bit (RRS in CAN FD)."""
    if can_id & EXTENDED:
        identifier = f"{can_id & EXTENDED_MASK:029b}"
        return identifier[:11] + "11" + identifier[11:] + last
    return f"{can_id & STANDARD_MASK:011b}" + last + "0"


def crc15(bits: str) -> int:
    """Remainder of the bits, followed by fifteen zeros, on division by the generator polynomial."""
    remainder = 0
    for bit in bits:
        # the shift register of ISO 11898-1, a bit at a time: the input is a text of bits anyway
        remainder = remainder << 1 ^ (CRC15 if (remainder >> 14 & 1) ^ (bit == "1") else 0)
    return remainder & 0x7FFF


def stuffed(bits: str) -> str:
    """The bits as sent: after five equal ones the opposite one is put in."""
    sent: list[str] = []
    run, previous = 0, ""
    for bit in bits:
        run = run + 1 if bit == previous else 1
        previous = bit
        sent.append(bit)
        if run == 5:
            previous = "1" if bit == "0" else "0"
            sent.append(previous)
            # the stuff bit itself starts the next run of equal bits
            run = 1
    return "".join(sent)


def fd_lengths(frame: Frame) -> tuple[int, int]:
    """Bits of a CAN FD frame at the nominal rate and at the data rate."""
    length = len(frame.data)
    # DLC 0 to 8 is the length itself; 9 to 15 stand for the seven longer lengths
    code = _FD_CODES.get(length, length)
    reserved = "10" + ("1" if frame.flags & BRS else "0")  # FDF, res, BRS
    before = "0" + _identifier_bits(frame.can_id, "0") + reserved
    after = "0" + f"{code:04b}" + "".join(f"{byte:08b}" for byte in frame.data)  # ESI, DLC, data
    slow = len(stuffed(before))
    # A run of five that ends with the data is broken by the fixed stuff bit that follows anyway.
    fast = len(stuffed((before + after)[:-1])) + 1 - slow
    # CRC-17 covers up to 16 data bytes, CRC-21 the longer frames; the 4 bits are the stuff count
    crc = 17 if length <= 16 else 21
    fixed = 1 + (4 + crc) // 4  # one before the stuff count, then one after every fourth bit
    return slow + FD_TAIL, fast + 4 + crc + fixed + 1
