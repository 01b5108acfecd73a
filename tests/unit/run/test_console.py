"""Output of a flight on the terminal."""

import io
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from rich.console import Console
from typer.main import get_command

import companion.commands.cli
import sitl.commands.cli
from companion.run.console import ProgressLine
from companion.ticks import Progress


def test_notices_to_the_pilot_are_plain_text_on_a_pipe() -> None:
    pipe = io.StringIO()
    with ProgressLine(Console(file=pipe, markup=False)) as line:
        line.show(Progress(0.0, "arming", "", tuple, notice="throttle [at the middle] first"))
    assert pipe.getvalue().splitlines()[0] == "throttle [at the middle] first"


def parameters(command: Any) -> Iterator[Any]:
    """Parameters of a command and of all its subcommands, including lazily loaded ones."""
    yield from command.params
    if hasattr(command, "list_commands"):
        context = command.make_context("", [], resilient_parsing=True)
        for name in command.list_commands(context):
            yield from parameters(command.get_command(context, name))


@pytest.mark.parametrize("app", [companion.commands.cli.commands, sitl.commands.cli.commands])
def test_no_help_text_is_parsed_as_markup(app: typer.Typer) -> None:
    """The help text once lacked the name "[mission]", which Rich reads as markup."""
    helps = {p.name: getattr(p, "help", None) or "" for p in parameters(get_command(app))}
    assert len(helps) > 20
    assert [n for n, text in helps.items() if "[" in text.replace(r"\[", "")] == []
