"""Exceptions of the companion, under one root, with texts for the user."""


class CompanionError(Exception):
    """Root of all errors that are shown to the user as one line."""


class ConfigError(CompanionError, ValueError):
    """A configuration file, key or value is not valid."""


class SensorError(CompanionError, OSError):
    """A sensor is absent, has the wrong identity, or is not reliable."""


class LinkError(CompanionError, OSError):
    """The autopilot cannot be reached or does not answer."""


class LogError(CompanionError, ValueError):
    """A recorded log contains no data for a map."""


class OutputError(CompanionError, OSError):
    """A result cannot be written."""


class RecordingError(CompanionError, OSError):
    """A recording cannot be written or read."""


class RehearsalError(CompanionError, RuntimeError):
    """A real drone has not passed the rehearsal of this flight."""


class SurveyError(CompanionError, ValueError):
    """Flights cannot be made into one map."""


class SecretError(CompanionError, OSError):
    """A file with a key or token is missing, or others can read it."""


class TeamError(CompanionError, OSError):
    """The radio of a team cannot be opened."""


class ViewError(CompanionError, OSError):
    """A page or a feed cannot be opened."""


class FlightEndedError(CompanionError, RuntimeError):
    """A flight ended differently than its script expects."""


class NotCompletedError(CompanionError, RuntimeError):
    """A step of a script was not completed, and the drone hovers."""


class MissingExtraError(CompanionError, ImportError):
    """A library of an optional extra is missing."""
