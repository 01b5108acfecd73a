"""What SITL can refuse, in one line for the person reading it."""


class SitlError(Exception):
    """Root of the errors that end a `sitl` command with one line."""
