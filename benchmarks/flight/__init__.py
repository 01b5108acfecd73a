"""Flights: speed, response, clutter, endurance."""
