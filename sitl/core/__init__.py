"""Shared by all rooms of the simulator: ground truth, vehicle, noise, radio, errors."""
