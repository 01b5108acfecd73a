"""Independent random streams, one for each cause of noise, all grown from the flight's seed."""

import random


def stream(seed: int, name: str) -> random.Random:
    """The generator of one named cause; a new cause never shifts the draws of another."""
    return random.Random(f"{seed}/{name}")
