"""What only some machines have installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from companion.errors import MissingExtraError


@contextmanager
def needs_extra(extra: str) -> Iterator[None]:
    """Whatever is missing inside is told of in one line, with the remedy.

    Raises:
        MissingExtraError: in place of ModuleNotFoundError.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"this needs {error.name}, which is not installed: "
            f"pip install 'pdps-companion[{extra}]'"
        ) from error
