"""A busy machine is no failure: hypothesis gives no example a deadline."""

from hypothesis import settings

settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")
