"""Defines options that several commands share, and loads the configuration."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

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
Foxglove = Annotated[
    str | None,
    typer.Option(
        metavar="[HOST:PORT]",
        help="Publish the flight live for Foxglove, by default at 127.0.0.1:8765; docs/live.md.",
    ),
]
FOXGLOVE_ADDRESS = "127.0.0.1:8765"
"""Default of `--foxglove`: this machine only, and the port to which Foxglove connects by itself."""


class WithFoxglove(TyperCommand):
    """A command with the option `Foxglove`, whose value may be left out."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments; typer itself has no option with an optional value."""
        following = [*args, ""][1:]
        return super().parse_args(
            ctx,
            [
                f"{arg}={FOXGLOVE_ADDRESS}"
                if arg == "--foxglove" and not re.fullmatch(r"[^:-][^:]*:\d+", after)
                else arg
                for arg, after in zip(args, following, strict=True)
            ],
        )


def load_settings(
    config: Path | None,
    link: str | None,
    bus: str | None,
    profile: str | None,
    *,
    mission: str | None = None,
    mission_set: Sequence[str] = (),
    foxglove: str | None = None,
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
        "view.foxglove": foxglove,
    }
    chosen = {key: value for key, value in given.items() if value is not None}
    return configuration.load(config, {**chosen, **configuration.mission_settings(mission_set)})
