"""Sensors, their calibration, and the drone's computer."""
