"""Messages between the drones of a team: MessagePack, versioned, bounded, checked on arrival.

    packet = [version, team, drone, instance, number, body]

    State        5 times a second: pose, phase, target, and what has arrived from each teammate
    WallLines    every 2 s: all walls
    MapPiece     rays of some seconds and their keyframes; repeated until every teammate has it
    Keyframes    every second: a block of the trajectory, after corrections
    Track        twice a second, if it traces a room: its way along the walls
    LowCeilings  every 4 s, in the mission "layers": what hangs low

All places are in the sender's own frame: local NED from its take-off point and heading.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Raw, Struct, msgpack

from companion.config.team import MAX_DRONES, MAX_LAYERS
from companion.core.arrays import Array, Indices
from companion.core.frames import wrap_rad
from companion.mapping.redrawn_grid import RAY_COLUMNS

VERSION = 5
"""Version of the messages; a drone drops those of another version."""
MAX_PACKET_BYTES = 8200
"""A longer packet is dropped. Chosen: the longest message, 400 walls, has 8000 and a header."""
MAX_PLACES = 64
"""Most places of a target. Chosen."""

Metres = Annotated[float, Meta(ge=-1e4, le=1e4)]
Radians = Annotated[float, Meta(ge=-100.0, le=100.0)]
Seconds = Annotated[float, Meta(ge=0.0, le=1e6)]
Count = Annotated[int, Meta(ge=0, le=1_000_000)]
Drone = Annotated[int, Meta(ge=1, le=MAX_DRONES)]
Layer = Annotated[int, Meta(ge=0, lt=MAX_LAYERS)]
"""Number of a layer, from the lowest, which is 0."""
Place = tuple[Metres, Metres]

RAY_FIELDS = (
    ("forward_mm", "<i2", 1e-3),
    ("right_mm", "<i2", 1e-3),
    ("bearing_e4", "<i2", 1e-4),
    ("end_mm", "<u2", 1e-3),
    ("sigma_mm", "<u2", 1e-3),
    ("is_hit", "u1", 1.0),
)
"""Columns 1 to 6 of a ray of `RedrawnGrid` in a `MapPiece`: name, type, and unit in m or rad."""
RAY = np.dtype([("keyframe", "<u2"), *((name, kind) for name, kind, _ in RAY_FIELDS)])
"""A ray in a `MapPiece`, relative to its keyframe."""


class State(Struct, tag="state", frozen=True, array_like=True):
    """Where a drone is, and what it does."""

    ne_m: Place
    height_m: Metres
    yaw_rad: Radians
    velocity_ne_m_s: Place
    position_sigma_m: Annotated[float, Meta(ge=0, le=1e4)]
    phase: Annotated[str, Meta(max_length=80)]
    is_flying: bool
    needs_column: bool
    """It climbs or descends: the space above and below it must be free."""
    waits: bool
    """It waits for others, and lets them pass."""
    battery: Annotated[float, Meta(ge=0, le=1)]
    target: Annotated[tuple[Place, ...], Meta(max_length=MAX_PLACES)]
    """Places that it goes to look at."""
    is_extra: bool
    """The mission is complete without it."""
    arrives_in_s: Seconds
    """Time until it can see them, s."""
    received: Annotated[dict[Drone, Count], Meta(max_length=MAX_DRONES)]
    """Number of map pieces that it has of each teammate, from the first on."""
    layer: Layer | None
    """The layer in which it works, or to which it climbs; None on the ground or on its way home."""
    layers_seen: Annotated[tuple[Layer, ...], Meta(max_length=MAX_LAYERS)]
    """Layers of which it knows that they were seen, also from others."""
    doorway_ne_m: Place | None
    """Middle of the doorway in which it is, or to which it comes next."""
    links: Annotated[dict[Drone, Count], Meta(max_length=MAX_DRONES)]
    """The drones that it reaches, also through others, and over how many radio links."""


ON_PAD = State(
    ne_m=(0.0, 0.0),
    height_m=0.0,
    yaw_rad=0.0,
    velocity_ne_m_s=(0.0, 0.0),
    position_sigma_m=0.0,
    phase="",
    is_flying=False,
    needs_column=False,
    waits=False,
    battery=1.0,
    target=(),
    is_extra=False,
    arrives_in_s=0.0,
    received={},
    layer=None,
    layers_seen=(),
    doorway_ne_m=None,
    links={},
)
"""State of a drone that was not heard yet: it stands on its pad."""


class WallLines(Struct, tag="walls", frozen=True, array_like=True):
    """All walls of a drone."""

    rows: Annotated[bytes, Meta(max_length=8000)]
    """float32 (w, 5): direction of the normal, rad, offset, reach along the wall from and to, m, as
    in `Unknowns`, and sigma of the offset, m."""


class MapPiece(Struct, tag="piece", frozen=True, array_like=True):
    """Consecutive rays of the occupancy grid."""

    number: Count
    """Pieces are numbered from 0 on."""
    first: Count
    """Number of the first keyframe."""
    poses: Annotated[bytes, Meta(max_length=3600)]
    """float32 (k, 3): keyframes, north, east, yaw."""
    rays: Annotated[bytes, Meta(max_length=5200)]
    """(r,) of `RAY`; `keyframe` is relative to `first`."""
    layer: Layer


class Keyframes(Struct, tag="keyframes", frozen=True, array_like=True):
    """A block of the trajectory as it is estimated now."""

    first: Count
    poses: Annotated[bytes, Meta(max_length=3600)]
    """As in `MapPiece`."""


class Track(Struct, tag="track", frozen=True, array_like=True):
    """The round of a room."""

    wall_rad: Radians | None
    """Bearing of the perpendicular to the wall at which it begins; None: not chosen yet."""
    side: Annotated[int, Meta(ge=-1, le=1)]
    """1: clockwise, -1: counter-clockwise, 0: not chosen yet."""
    is_tracing: bool
    places: Annotated[bytes, Meta(max_length=6400)]
    """float32 (m, 2): where it has been along the walls."""


class LowCeilings(Struct, tag="low", frozen=True, array_like=True):
    """What the up beam has measured, the lowest places first."""

    rows: Annotated[bytes, Meta(max_length=4800)]
    """float32 (n, 3): north, east, and height of what hangs there, m."""


Body = State | WallLines | MapPiece | Keyframes | Track | LowCeilings


@dataclass(frozen=True, slots=True)
class Packet:
    """A message with its sender."""

    team: str
    drone: int
    instance: int
    """Differs at each start of the program, so that two drones of one number are noticed."""
    number: int
    """Increases with each packet of the sender."""
    body: Body


class PacketError(Exception):
    """A packet that cannot be used."""


class OtherVersionError(PacketError):
    """A packet of another version of the messages."""

    def __init__(self, team: str, drone: int, version: int) -> None:
        super().__init__(f"drone {drone} sends version {version}, this is {VERSION}")
        self.team, self.drone = team, drone


class _Header(Struct, frozen=True, array_like=True):
    version: int
    team: Annotated[str, Meta(max_length=32)]
    drone: Drone
    instance: Annotated[int, Meta(ge=0)]
    number: Annotated[int, Meta(ge=0)]
    body: Raw


_encoder = msgpack.Encoder()
_header_decoder = msgpack.Decoder(_Header)
_body_decoder = msgpack.Decoder(Body)


def encode(packet: Packet) -> bytes:
    """The bytes of a packet."""
    body = Raw(_encoder.encode(packet.body))
    return _encoder.encode(
        _Header(VERSION, packet.team, packet.drone, packet.instance, packet.number, body)
    )


def decode(data: bytes) -> Packet:
    """The packet in some bytes.

    Raises:
        OtherVersionError: it is of another version.
        PacketError: it is damaged, too long, or a value is out of its bounds.
    """
    if len(data) > MAX_PACKET_BYTES:
        raise PacketError(f"{len(data)} bytes")
    try:
        header = _header_decoder.decode(data)
        if header.version != VERSION:
            raise OtherVersionError(header.team, header.drone, header.version)
        body: Body = _body_decoder.decode(header.body)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise PacketError(str(error)) from None
    return Packet(header.team, header.drone, header.instance, header.number, body)


def pack_floats(values: Array) -> bytes:
    """Values (n, m) as float32."""
    return values.astype("<f4").tobytes()


def unpack_floats(data: bytes, columns: int) -> Array:
    """(n, columns): what `pack_floats` packed.

    Raises:
        PacketError: the length is wrong, or a value is not finite or too large.
    """
    if len(data) % (4 * columns):
        raise PacketError(f"{len(data)} bytes are not rows of {columns}")
    values: Array = np.frombuffer(data, dtype="<f4").reshape(-1, columns).astype(np.float64)
    if not (np.abs(values) <= 1e4).all():
        raise PacketError("a value is too large or not a number")
    return values


def pack_rays(rays: Array, first: int) -> bytes:
    """Rays (r, 8) of `RedrawnGrid.rays_from`; `first`: their first keyframe."""
    packed = np.zeros(len(rays), dtype=RAY)
    columns = rays[:, 1 : len(RAY_FIELDS) + 1].copy()
    columns[:, 2] = wrap_rad(columns[:, 2])
    packed["keyframe"] = rays[:, 0] - first
    for (name, kind, unit), values in zip(RAY_FIELDS, columns.T, strict=True):
        bounds = np.iinfo(kind)
        packed[name] = np.clip(np.rint(values / unit), bounds.min, bounds.max)
    return packed.tobytes()


def unpack_rays(data: bytes, first: int, keyframes: int, time_s: float) -> Array:
    """(r, 8): rays for `RedrawnGrid.extend`, measured at `time_s`; there are `keyframes` of them.

    Raises:
        PacketError: the length is wrong, or a ray has no keyframe.
    """
    if len(data) % RAY.itemsize:
        raise PacketError(f"{len(data)} bytes are not rays")
    packed = np.frombuffer(data, dtype=RAY)
    keyframe: Indices = packed["keyframe"].astype(np.int64)
    if len(keyframe) and (keyframe.max() >= keyframes or (np.diff(keyframe) < 0).any()):
        raise PacketError("the rays are not in the order of their keyframes")
    rays = np.empty((len(packed), RAY_COLUMNS))
    rays[:, 0] = keyframe + first
    for column, (name, _, unit) in enumerate(RAY_FIELDS, 1):
        rays[:, column] = packed[name] * unit
    rays[:, -1] = time_s
    return rays
