"""Everything the companion can refuse, under one root, with words for the person reading it."""


class CompanionError(Exception):
    """Root of all errors that are told to the user as one line."""


class ConfigError(CompanionError, ValueError):
    """A configuration file, key or value that cannot be used."""


class SensorError(CompanionError, OSError):
    """A sensor that is absent, is not what it should be, or cannot be trusted."""


class LinkError(CompanionError, OSError):
    """The autopilot cannot be reached or does not answer."""


class LogError(CompanionError, ValueError):
    """A recorded log that holds nothing to make a map of."""


class OutputError(CompanionError, OSError):
    """A result that cannot be written."""


class RecordingError(CompanionError, OSError):
    """A recording that cannot be written or read."""


class ViewError(CompanionError, OSError):
    """A page or a feed that cannot be opened."""


class FlightEndedError(CompanionError, RuntimeError):
    """A flight that ended otherwise than its script meant it to."""


class MissingExtraError(CompanionError, ImportError):
    """A library that only an extra brings along."""
