"""The option `--version` of both commands."""

from importlib.metadata import version

import pytest
import typer
from typer.testing import CliRunner

from companion.commands import cli as companion
from sitl.commands import cli as sitl


@pytest.mark.parametrize("commands", [companion.commands, sitl.commands])
def test_both_commands_print_their_version(commands: typer.Typer) -> None:
    result = CliRunner().invoke(commands, ["--version"])
    assert (result.exit_code, result.stdout.strip()) == (0, version("pdps-companion"))
