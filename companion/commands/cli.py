"""Runs the command line of `companion`; loads the module of a command only when it is called.

After a crash in flight every tenth of a second counts. Loading the modules of a flight takes longer
than sending the first heartbeat, so `companion recover` loads them afterwards.
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
"""Exit status of a refused command. Chosen."""
MODULES = {
    "fly": "companion.commands.fly",
    "recover": "companion.commands.recover",
    "check": "companion.commands.check",
    "calibrate": "companion.commands.calibrate",
    "map": "companion.commands.map",
    "replay": "companion.commands.recording",
    "export": "companion.commands.recording",
    "report": "companion.commands.recording",
    "merge": "companion.commands.merge",
    "survey": "companion.commands.survey",
    "view": "companion.commands.view",
    "map-schema": "companion.commands.map",
    "config": "companion.commands.config",
}
"""Module of each command, in the order of the help."""


class Commands(TyperGroup):
    """Loads commands by name; selects one of several commands in a module."""

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
    """Map unknown rooms with a drone, or make a map from a recorded log."""


def main() -> None:
    """Run a command; an error is one line on stderr and exit status 2."""
    terminal.set_up()
    try:
        with terminal.checked_output("companion"):
            commands()
    except CompanionError as error:
        # markup off: the error text may contain brackets
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"companion: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None
