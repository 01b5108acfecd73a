"""Configuration of the drones that fly together."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from companion.config.range_sensors import Group

MAX_DRONES = 8
"""Most drones of a team. Chosen."""
MAX_LAYERS = 64
"""Most layers that a team flies. Chosen: 38 m above the lowest, at the usual spacing."""
TEAM_DRONES = {"room": 2, "building": MAX_DRONES, "exterior": MAX_DRONES, "layers": MAX_DRONES}
"""Missions that a team divides, and between how many drones."""


class PadConfig(Group):
    """Where a drone of a team starts, in the frame of the first drone's start."""

    north_m: float = Field(0.0, ge=-1000, le=1000)
    """Distance ahead of the first drone, m."""
    east_m: float = Field(0.0, ge=-1000, le=1000)
    """Distance to the right of the first drone, m."""
    heading_deg: float = Field(0.0, ge=-360, le=360)
    """Heading relative to that of the first drone, clockwise."""


class TeamConfig(Group):
    """The drones that fly together."""

    name: str = Field("", pattern=r"^[A-Za-z0-9_-]{0,32}$")
    """Name of the team. Drones of one name share their maps. Empty: the drone flies alone."""
    drone: int = Field(1, ge=1, le=MAX_DRONES)
    """Number of this drone in `pads`, from 1 on."""
    pads: tuple[PadConfig, ...] = Field((PadConfig(),), max_length=MAX_DRONES)
    """Start of each drone of the team."""
    addresses: tuple[Annotated[str, Field(pattern=r"^[^\s:/]+:\d{1,5}$")], ...] = Field(
        (), max_length=MAX_DRONES
    )
    """`HOST:PORT` at which each drone listens. Default: this machine, from port 7447 on."""
    interface: str = Field("", pattern=r"^[A-Za-z0-9._-]{0,15}$")
    """Network interface on which the drones find each other by multicast, e.g. wlan0; instead of
    `addresses`."""
    key_file: Path | None = None
    """File with the team's key, mode 600, the same on all drones. Required unless all addresses, or
    the interface, are on this machine."""
    pad_sigma_m: float = Field(0.1, gt=0, le=1)
    """Standard deviation of a start from its pad, on each axis, m."""
    pad_sigma_deg: float = Field(3.0, gt=0, le=20)
    """Standard deviation of its heading."""

    @model_validator(mode="after")
    def _check_pads(self) -> Self:
        if self.name and self.drone > len(self.pads):
            raise ValueError(
                f"drone {self.drone} has no start: team.pads has {len(self.pads)} entries; "
                "give one for each drone"
            )
        if self.addresses and self.interface:
            raise ValueError(
                f"team.interface is {self.interface!r}, and team.addresses is given, too; "
                "remove one of them"
            )
        if self.addresses and len(self.addresses) != len(self.pads):
            raise ValueError(
                f"team.addresses has {len(self.addresses)} entries, and team.pads "
                f"{len(self.pads)}; give one of each for each drone"
            )
        return self
