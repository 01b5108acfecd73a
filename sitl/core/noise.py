"""Independent random streams, one per noise source, all derived from the flight's seed."""

import random


def stream(seed: int, name: str) -> random.Random:
    """Generator of one noise source. A new source never changes the draws of another."""
    return random.Random(f"{seed}/{name}")
