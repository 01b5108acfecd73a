"""Defines options that several commands share, and loads the configuration."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from companion.config import settings as configuration
from companion.config.settings import Config

ConfigFile = Annotated[Path | None, typer.Option(help="TOML file; see docs/config.md.")]
LinkUrl = Annotated[
    str | None, typer.Option(help="udpin:HOST:PORT, udpout:HOST:PORT or serial:/dev/PORT:BAUD.")
]
BusUrl = Annotated[str | None, typer.Option(help="/dev/i2c-N or sitl://HOST:PORT.")]
Profile = Annotated[str | None, typer.Option(help="Model of all range sensors.")]
MissionSet = Annotated[
    list[str] | None,
    typer.Option("--set", help=r"KEY=VALUE of \[mission], such as speed_m_s=0.6; repeatable."),
]


def load_settings(
    config: Path | None,
    link: str | None,
    bus: str | None,
    profile: str | None,
    *,
    mission: str | None = None,
    mission_set: Sequence[str] = (),
) -> Config:
    """Load the configuration file; options of the command line override it.

    Raises:
        ConfigError: the file or an option is not valid; one line with the remedy.
    """
    given = {
        "link.url": link,
        "sensors.bus": bus,
        "sensors.profile": profile,
        "mission.kind": mission,
    }
    chosen = {key: value for key, value in given.items() if value is not None}
    return configuration.load(config, {**chosen, **configuration.mission_settings(mission_set)})
