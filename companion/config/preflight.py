"""Configuration of what a flight of a real drone needs before it may take off."""

from pathlib import Path

from pydantic import Field

from companion.config.range_sensors import Group


class PreflightConfig(Group):
    """What a drone with sensors on a bus of this machine needs before take-off; not on SITL's."""

    transmitter: bool = True
    """Take off only while the autopilot receives a transmitter, and from a mode in which the drone
    holds its height: the pilot's switch takes it back to this mode. `false` flies without a
    pilot."""
    rehearsal_file: Path = Path("rehearsal.json")
    """File in which `companion fly --rehearse` stores its pass, and in which a flight looks for it.
    """
    rehearsal_days: float = Field(7.0, gt=0, le=366)
    """Time for which a pass is valid, days."""
