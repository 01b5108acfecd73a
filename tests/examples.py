"""Numbers of examples for hypothesis."""

from hypothesis import settings

MIN_EXAMPLES = 3
"""Minimum number of examples of a property. Chosen."""


def examples(number: int) -> int:
    """Scale a property's number of examples by the profile: `test-fast` uses a fifth."""
    default = settings.get_profile("default").max_examples
    return max(number * settings().max_examples // default, MIN_EXAMPLES)
