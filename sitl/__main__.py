"""Runs the command `sitl`, also as `python -m sitl`; reports a missing extra in one line."""

import sys

from companion.core import terminal
from companion.core.errors import MissingExtraError
from companion.core.extras import needs_extra

EXIT_REFUSED = 2
"""Exit status without the extra `sitl`."""


def main() -> None:
    """Run a command. Without the extra `sitl`: one line on stderr and exit status 2."""
    terminal.set_up()
    try:
        with needs_extra("sitl"):
            from sitl.commands import cli  # noqa: PLC0415 - an extra
    except MissingExtraError as missing:
        print(f"sitl: {missing}", file=sys.stderr)  # noqa: T201 - a command
        raise SystemExit(EXIT_REFUSED) from None
    cli.main()


if __name__ == "__main__":
    main()
