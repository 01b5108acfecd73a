"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from companion import config as configuration
from companion.config import Config

ConfigFile = Annotated[Path | None, typer.Option(help="TOML file; see docs/config.md.")]
LinkUrl = Annotated[
    str | None, typer.Option(help="udpin:HOST:PORT, udpout:HOST:PORT or serial:/dev/PORT:BAUD.")
]
BusUrl = Annotated[str | None, typer.Option(help="/dev/i2c-N or sitl://HOST:PORT.")]
Profile = Annotated[str | None, typer.Option(help="Range sensors, all of one kind.")]


def load_settings(
    config: Path | None,
    link: str | None,
    bus: str | None,
    profile: str | None,
    *,
    mission: str | None = None,
) -> Config:
    """The file, with what was given on the command line above it.

    Raises:
        ConfigError: one line that says what to mend.
    """
    given = {
        "link.url": link,
        "sensors.bus": bus,
        "sensors.profile": profile,
        "mission.kind": mission,
    }
    return configuration.load(config, {k: v for k, v in given.items() if v is not None})
