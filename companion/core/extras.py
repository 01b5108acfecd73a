"""Optional dependencies, which not every machine has installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from companion.core.errors import MissingExtraError

PACKAGES_OF_EXTRA = {
    "sitl": ("fcl", "evo", "PIL", "shapely", "yaml"),
    "export": ("ezdxf", "pyoctomap"),
    "ifc": ("ifcopenshell",),
    "team": ("zenoh",),
    "foxglove": ("foxglove",),
    "viewer": ("viser", "websockets"),
}
"""Packages of each extra of pyproject.toml, by import name."""


@contextmanager
def needs_extra(extra: str) -> Iterator[None]:
    """Report a missing optional dependency in one line, with the remedy.

    A package that belongs to another extra is reported with that extra.

    Raises:
        MissingExtraError: replaces ModuleNotFoundError.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        name = next(
            (name for name, packages in PACKAGES_OF_EXTRA.items() if package in packages), extra
        )
        raise MissingExtraError(
            f"this needs {error.name}, which is not installed: pip install 'pdps-companion[{name}]'"
        ) from error
