"""Prints schema and reference of the configuration file: `companion config schema`, `reference`."""

import json

import typer

from companion.config.reference import markdown
from companion.config.schema import json_schema

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Print the JSON schema and the reference of the configuration file.",
)


@commands.command()
def schema() -> None:
    """Print the JSON schema of the configuration file, for editors; see docs/config.md."""
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@commands.command()
def reference() -> None:
    """Print docs/config-reference.md: every key with type, default, bounds and meaning."""
    print(markdown(), end="")
