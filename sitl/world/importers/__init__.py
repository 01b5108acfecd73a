"""Buildings in other people's formats. An importer mends or refuses, and says what it did."""

CEILING_M = 2.6
"""Plans have no heights; this is the ceiling that their walls reach to."""
FARTHEST_M = 1000.0
"""From the origin; what is farther away has a slip in its numbers."""
MAX_WALLS = 50_000
