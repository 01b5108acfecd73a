"""Imports buildings from other formats. An importer repairs or rejects, and reports what it did."""

CEILING_M = 2.6
"""Ceiling height of plans without heights, m. Chosen."""
FARTHEST_M = 1000.0
"""Largest distance from the origin, m; larger values are errors. Chosen."""
MAX_WALLS = 50_000
"""Largest number of walls. Chosen."""
