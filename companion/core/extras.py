"""What only some machines have installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from companion.core.errors import MissingExtraError

BRINGS = {
    "sitl": ("fcl", "evo", "PIL", "shapely", "yaml"),
    "export": ("ezdxf", "pyoctomap"),
    "viewer": ("viser", "websockets"),
}
"""Packages that an extra of pyproject.toml installs, by the name that they are imported by."""


@contextmanager
def needs_extra(extra: str) -> Iterator[None]:
    """Whatever is missing inside is told of in one line, with the remedy.

    A package that another extra is known to bring along is told with that one.

    Raises:
        MissingExtraError: in place of ModuleNotFoundError.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        its = next((name for name, packages in BRINGS.items() if package in packages), extra)
        raise MissingExtraError(
            f"this needs {error.name}, which is not installed: pip install 'pdps-companion[{its}]'"
        ) from error
