"""Models a beam of light instead of a ray: width, lost returns, and the paper's sensor shift.

All effects are off unless a file such as this sets them:

width_deg = 2.0    # over an edge the spot is split and the reading lies between
steep_deg = 60.0   # steeper incidence loses returns
dropout = 0.01     # share of measurements that read "nothing in range"
shift_m = 0.02     # the paper's noise: a random shift of the sensor in x, y and z
"""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from companion.core.frames import Vector3
from companion.core.textfile import read_text
from sitl.core.errors import SitlError, error_line
from sitl.core.noise import stream
from sitl.world.geometry.model import Hit

RangeQuery = Callable[[Vector3, Vector3, float], float | None]
"""(origin_ned_m, direction_ned, most_m) -> distance to the first surface, or None."""
HitsQuery = Callable[[Vector3, Sequence[Vector3], float, float], list[Hit | None]]
"""(origin_ned_m, rays_ned with the axis first, most_m, half_angle_rad) -> each ray's hit."""

RING_RAYS = 6
"""Rays around the axis."""
RING_SHARE = math.sqrt(7 / 12)
"""Angle of the ring's rays as a share of the cone's half angle.

Axis and six rays then have the spread of an evenly lit spot: its mean square radius is half the
square of its rim's radius.
"""
MIN_M = 1e-6
"""Smallest distance, m. Avoids a division by zero where the sensor touches a surface."""


class BeamError(SitlError, ValueError):
    """A file of beam physics is invalid; the text names key, value and bound."""


class BeamPhysics(BaseModel):
    """Difference between a range sensor's light and a ray; the default is a ray."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    width_deg: float = Field(0.0, ge=0, le=30)
    """Full angle of the cone of light, degrees."""
    steep_deg: float = Field(90.0, ge=0, le=90)
    """Largest incidence angle, from the surface's normal, at which all light returns, degrees.

    Beyond it the probability of a lost return grows linearly, to 1 at 90 degrees.
    """
    dropout: float = Field(0.0, ge=0, le=1)
    """Probability that a measurement reads "nothing in range"."""
    shift_m: float = Field(0.0, ge=0, le=1)
    """Standard deviation of the sensor's random shift in each of x, y and z, m.

    Drawn anew for every measurement; the noise of the paper's own simulator.
    """


RAY = BeamPhysics()
"""An ideal ray: no width, no losses, no shift."""


def beam_physics(values: Mapping[str, object], source: str) -> BeamPhysics:
    """Validate beam physics.

    Raises:
        BeamError: a key is unknown or a value out of bounds.
    """
    try:
        return BeamPhysics.model_validate(values)
    except ValidationError as error:
        raise BeamError(f"{source}: {error_line(error)}") from error


def load_beam_physics(path: Path) -> BeamPhysics:
    """Read beam physics from a TOML file.

    Raises:
        BeamError: the file cannot be read or is invalid.
    """
    try:
        return beam_physics(tomllib.loads(read_text(path)), str(path))
    except OSError as error:
        raise BeamError(f"{path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # also from huge numbers and deep nesting
        raise BeamError(f"{path}: not TOML: {error}") from error


class LightBeam:
    """The beam of the sensor called `name`; each effect has its own random stream."""

    def __init__(self, physics: BeamPhysics, hits: HitsQuery, seed: int, name: str) -> None:
        self._physics = physics
        self._hits = hits
        self._half_angle_rad = RING_SHARE * math.radians(physics.width_deg / 2)
        self._dropout = stream(seed, f"dropout {name}")
        self._steepness = stream(seed, f"incidence {name}")
        self._shift = stream(seed, f"shift {name}")

    def range_m(self, origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        """One measurement: the distance that the sensor measures, m, or None."""
        fate = self._steepness.random()
        is_lost = self._dropout.random() < self._physics.dropout
        north, east, down = (x + self._shift.gauss(0, self._physics.shift_m) for x in origin)
        if is_lost:
            return None
        rays = self._rays(direction)
        hits = self._hits((north, east, down), rays, most_m, self._half_angle_rad)
        return _triangulated([hit for hit in hits if hit and fate >= self._loss(hit)])

    def _rays(self, direction: Vector3) -> list[Vector3]:
        if not self._half_angle_rad:
            return [direction]
        return [direction, *_ring(direction, self._half_angle_rad)]

    def _loss(self, hit: Hit) -> float:
        """Probability that light at this incidence does not return."""
        steep_deg = self._physics.steep_deg
        beyond_deg = math.degrees(math.acos(min(hit.cos_incidence, 1.0))) - steep_deg
        return beyond_deg / (90 - steep_deg) if beyond_deg > 0 else 0.0


def _triangulated(hits: Sequence[Hit]) -> float | None:
    """Distance of the returned light's centre of gravity on the detector, m.

    The spot's position on the detector is proportional to 1/distance. Its brightness follows
    Lambert's cosine over distance².
    """
    lit = [(hit.cos_incidence, max(hit.distance_m, MIN_M)) for hit in hits]
    light = sum(cos / distance_m**2 for cos, distance_m in lit)
    moment = sum(cos / distance_m**3 for cos, distance_m in lit)
    return light / moment if moment else None


def _ring(axis: Vector3, half_angle_rad: float) -> list[Vector3]:
    """Unit vectors spaced evenly around the axis, all at that angle from it."""
    x, y, z = axis
    # Perpendicular to the axis: x̂ × axis, or ŷ × axis if x̂ is nearly parallel to it.
    across = (0.0, -z, y) if abs(x) < 0.6 else (z, 0.0, -x)
    length = math.hypot(*across)
    ux, uy, uz = across[0] / length, across[1] / length, across[2] / length
    vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    along, aside = math.cos(half_angle_rad), math.sin(half_angle_rad)
    ring = []
    for i in range(RING_RAYS):
        turn_rad = 2 * math.pi * i / RING_RAYS
        u, v = aside * math.cos(turn_rad), aside * math.sin(turn_rad)
        ring.append(
            (
                along * x + u * ux + v * vx,
                along * y + u * uy + v * vy,
                along * z + u * uz + v * vz,
            )
        )
    return ring
