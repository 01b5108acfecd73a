"""What the rooms of the simulator share: truth, the vehicle, noise, radio, errors."""
