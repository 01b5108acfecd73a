"""How exactly a person puts a drone on a marked pad."""

PAD_SIGMA_M, PAD_SIGMA_DEG = 0.05, 3.0
"""Standard deviations of the place, on each axis, m, and of the heading, °. Chosen."""
