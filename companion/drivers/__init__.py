"""Sensor drivers. The same drivers run on hardware and against SITL; only the bus differs."""
