"""Generates random and mutated input: MAVLink frames, bus requests, bytes of serial ports."""

import struct
from collections.abc import Sequence
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.drivers.wires.served_bus import REQUEST, TRANSACTION
from companion.link.transports.transport import Message, make_codec

HANDLED = tuple(
    mavlink.mavlink_map[message_id]
    for message_id in (
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE,
        mavlink.MAVLINK_MSG_ID_ODOMETRY,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
        mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
        mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_SET_MODE,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE,
        mavlink.MAVLINK_MSG_ID_VISION_SPEED_ESTIMATE,
    )
)
"""Messages that the emulated autopilot handles."""
ADDRESSED = tuple(kind for kind in HANDLED if "target_system" in kind.fieldnames)
"""Those of them with a target system."""
OTHER_SYSTEM = 7
"""MAVLink system ID that is not the vehicle's. Chosen."""
COMMANDS = (22, 21, 176, 400, 401, 410, 510, 511, 512, 520, 31999)
"""MAV_CMD numbers, the last one unknown."""
NAMES = (
    b"GUID_TIMEOUT",
    b"EK3_SRC1_VELXY",
    b"EK3_SRC1_POSXY",
    b"VISO_TYPE",
    b"EKF2_EV_CTRL",
    b"MPC_XY_VEL_MAX",
    b"WPNAV_SPEED",
    b"COM_OBL_RC_ACT",
    b"COM_OF_LOSS_T",
    b"MIS_TAKEOFF_ALT",
    b"",
    b"\xff" * 16,
)
"""Values of text fields: parameter names, known and unknown, an empty one, and invalid text."""
ODD_FLOATS = (0.0, 1.0, -1.0, 1e-40, 1e30, -1e30, float("nan"), float("inf"), float("-inf"))
"""Values of real fields: common, denormal, very large and not finite."""
BITS = {"uint8_t": 8, "int8_t": 8, "uint16_t": 16, "int16_t": 16, "uint32_t": 32, "int32_t": 32}
"""Width of the integer types of MAVLink fields, bits."""


def mavlink_frame(random: Random) -> bytes:
    """A frame to the autopilot: valid with odd values, mutated, or random bytes."""
    kind = random.random()
    if kind < 0.1:
        return random.randbytes(random.randrange(1, 60))
    frame = _message(random).pack(
        make_codec(random.choice((1, 1, 255)), random.choice((1, 190, 191)))
    )
    if kind < 0.3:
        mutated = bytearray(frame)
        for _ in range(random.randrange(1, 4)):
            mutated[random.randrange(len(mutated))] = random.randrange(256)
        return bytes(mutated)
    return bytes(frame)


VEHICLE_MESSAGES = tuple(
    mavlink.mavlink_map[message_id]
    for message_id in (
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    )
)
"""Messages from an autopilot that the companion handles."""


def vehicle_frame(random: Random) -> bytes:
    """A frame from a malfunctioning autopilot to its companion."""
    message = _message(random, VEHICLE_MESSAGES)
    if message.get_type() == "HEARTBEAT":
        message.autopilot = random.choice((3, 12, 12, message.autopilot))
    frame = bytearray(message.pack(make_codec(1, 1)))
    if random.random() < 0.1:
        frame[random.randrange(len(frame))] = random.randrange(256)
    return bytes(frame)


def serial_bytes(random: Random) -> bytes:
    """Frames of a TFmini-S, complete, truncated or wrong, with noise between them."""
    data = b""
    for _ in range(random.randrange(4)):
        frame = b"\x59\x59" + random.randbytes(6)
        frame += bytes([sum(frame) % 256 if random.random() < 0.8 else random.randrange(256)])
        data += frame[: random.choice((9, 9, 9, random.randrange(9)))]
        data += random.randbytes(random.choice((0, 0, 0, 5)))
    return data if random.random() < 0.95 else random.randbytes(2000)


def foreign_frame(random: Random) -> bytes:
    """Bytes without effect on vehicle 1: noise, a wrong checksum, half a frame, other systems."""
    kind = random.randrange(4)
    if kind == 0:
        return random.randbytes(random.randrange(1, 60))
    message = _message(random, ADDRESSED)
    message.target_system = OTHER_SYSTEM
    frame = bytearray(message.pack(make_codec(OTHER_SYSTEM, random.choice((1, 190, 191)))))
    if kind == 1:
        frame[-1] ^= random.randrange(1, 256)
    elif kind == 2:
        del frame[random.randrange(1, len(frame)) :]
    return bytes(frame)


def _message(random: Random, kinds: Sequence[type[Message]] = HANDLED) -> Message:
    kind = random.choice(kinds)
    values = []
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        count = lengths[name] if type_ != "char" else 0
        some = [_value(random, name, type_) for _ in range(max(count, 1))]
        values.append(some if count else some[0])
    return kind(*values)


def _value(random: Random, name: str, type_: str) -> object:
    if name == "command":
        return random.choice(COMMANDS)
    if name in ("target_system", "target_component"):
        return random.choice((0, 1, 1, 7))
    if type_ == "char":
        return random.choice(NAMES)
    if type_ == "float":
        return random.choice((*ODD_FLOATS, float(random.randrange(400)), random.gauss(0, 10)))
    if type_ in ("int64_t", "uint64_t"):
        return random.randrange(2**62)
    bits = BITS[type_]
    low = -(2 ** (bits - 1)) if type_.startswith("int") else 0
    return random.choice((0, 1, 8, low, low + 2**bits - 1, random.randrange(low, low + 2**bits)))


def bus_request(random: Random) -> bytes:
    """A request: transactions to real and absent chips, odd waits, odd clocks, or random bytes."""
    kind = random.random()
    if kind < 0.1:
        return random.randbytes(random.randrange(1, 40))
    if kind < 0.8:
        payload = b"".join(_transaction(random) for _ in range(random.randrange(4)))
        return REQUEST.pack(1, len(payload)) + payload
    if kind < 0.9:
        name = random.choice((b"/dev/spidev0.0", b"/dev/ttyAMA1", b"\xff", b""))
        data = random.randbytes(random.randrange(5))
        payload = bytes([random.choice((len(name), 0, 255))]) + name + data
        return REQUEST.pack(random.choice((3, 4)), len(payload)) + payload
    op = random.choice((0, 2, 2, 5, 255))
    payload = struct.pack("<d", random.choice(ODD_FLOATS)) + random.randbytes(
        random.choice((0, 10))
    )
    return REQUEST.pack(op, len(payload)) + payload


def _transaction(random: Random) -> bytes:
    data = random.randbytes(random.randrange(5))
    address = random.choice((0x48, 0x49, 0x6B, random.randrange(256)))
    wait_s = random.choice((0.0, 0.0, 0.0, 0.002, *ODD_FLOATS))
    return TRANSACTION.pack(address, len(data), random.randrange(256), wait_s) + data
