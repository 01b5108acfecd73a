"""Defines the option `--version` of both command lines."""

from importlib.metadata import version
from typing import Annotated

import typer


def _tell(is_asked: bool) -> None:
    if is_asked:
        print(version("pdps-companion"))
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_tell, is_eager=True, help="Print it and exit.")
]
