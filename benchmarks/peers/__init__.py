"""Compares the companion's map with those of other SLAM programs, from the same flights."""
