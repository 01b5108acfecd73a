"""What a person reads of a flight."""

import io

import pytest
import typer
from rich.console import Console

import companion.cli
import sitl.cli
from companion.app import Progress
from companion.console import ProgressLine


def test_on_a_pipe_what_the_pilot_is_to_know_is_plain_text() -> None:
    pipe = io.StringIO()
    with ProgressLine(Console(file=pipe, markup=False)) as line:
        line.show(Progress(0.0, "arming", "", tuple, notice="throttle [at the middle] first"))
    assert pipe.getvalue().splitlines()[0] == "throttle [at the middle] first"


@pytest.mark.parametrize("app", [companion.cli.commands, sitl.cli.commands])
def test_nothing_in_the_help_is_taken_for_markup(app: typer.Typer) -> None:
    """[mission] was left out of the sentence that names it."""
    left, options = [typer.main.get_command(app)], 0
    while left:
        command = left.pop()
        left += getattr(command, "commands", {}).values()
        options += len(command.params)
        for parameter in command.params:
            help_text = getattr(parameter, "help", None) or ""
            assert "[" not in help_text.replace(r"\[", ""), (command.name, parameter.name)
    assert options > 20
