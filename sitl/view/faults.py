"""Offers the actions of `sitl.testing` to the page: faults, the pilot, people."""

import inspect
from collections.abc import Mapping

from pydantic import ValidationError, validate_call

from sitl.core.errors import SitlError, error_line
from sitl.testing.actions.action import Action
from sitl.testing.actions.table import ACTIONS

PILOT = "pilot_"
"""Names of the pilot's actions begin with it."""


def names() -> list[str]:
    """Names of all actions, those of the pilot first."""
    return sorted(ACTIONS, key=lambda name: not name.startswith(PILOT))


def summary(name: str) -> str:
    """What an action does, in one sentence."""
    return (inspect.getdoc(ACTIONS[name]) or "").partition("\n\n")[0].replace("\n", " ")


def parameters(name: str) -> Mapping[str, inspect.Parameter]:
    """Parameters of an action by their name."""
    return inspect.signature(ACTIONS[name]).parameters


def action(name: str, arguments: Mapping[str, object]) -> Action:
    """The action with these arguments.

    Raises:
        SitlError: an argument is missing or invalid.
    """
    try:
        made: Action = validate_call(ACTIONS[name])(**arguments)
    except ValidationError as error:
        raise SitlError(f"{name}: {error_line(error)}") from error
    except ValueError as error:
        raise SitlError(f"{name}: {error}") from error
    return made
