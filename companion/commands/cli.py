"""The commands on the drone; each is loaded only when it is asked for.

After a crash in flight every tenth of a second counts, and most of what a flight needs takes longer
to load than to say that somebody is there again.
"""

from importlib import import_module
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from companion.commands.version import Version
from companion.core import terminal
from companion.core.errors import CompanionError

EXIT_REFUSED = 2
MODULES = {
    "fly": "companion.commands.fly",
    "recover": "companion.commands.recover",
    "check": "companion.commands.check",
    "calibrate": "companion.commands.calibrate",
    "map": "companion.commands.map",
    "replay": "companion.commands.recording",
    "export": "companion.commands.recording",
    "report": "companion.commands.recording",
    "view": "companion.commands.view",
    "config": "companion.commands.config",
}


class Commands(TyperGroup):
    """By name, from their modules; those of a module with several are picked out of it."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(MODULES)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in MODULES:
            return None
        found: Any = typer.main.get_command(import_module(MODULES[cmd_name]).commands)
        command = found.commands[cmd_name] if cmd_name in getattr(found, "commands", ()) else found
        command.name = cmd_name
        return command


commands = typer.Typer(
    cls=Commands, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)


@commands.callback()
def companion(version: Version = False) -> None:
    """Fly a drone through rooms it has never seen and bring back the map; or map a log."""


def main() -> None:
    """Run a command; anything refused is one line on stderr and exit status 2."""
    terminal.set_up()
    try:
        commands()
    except CompanionError as error:
        # what is told may look like the console's markup
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"companion: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None
