"""Simulates vehicle, sensors and world, and flies in lockstep with the companion."""
