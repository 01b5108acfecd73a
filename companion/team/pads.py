"""Where the drones of a team start, relative to each other."""

import math

import numpy as np

from companion.config.team import PadConfig, TeamConfig
from companion.core.arrays import Array
from companion.core.frames import ned_to_frd


def relative_pad(own: PadConfig, other: PadConfig) -> Array:
    """(3,): another pad in the frame of the own one: north, east, m, and heading, rad."""
    yaw_rad = math.radians(own.heading_deg)
    place = ned_to_frd(other.north_m - own.north_m, other.east_m - own.east_m, yaw_rad)
    return np.array([*place, math.radians(other.heading_deg) - yaw_rad])


def pad_sigma(team: TeamConfig) -> Array:
    """(3,): standard deviations of a start from its pad: north, east, m, and heading, rad."""
    return np.array([team.pad_sigma_m, team.pad_sigma_m, math.radians(team.pad_sigma_deg)])
