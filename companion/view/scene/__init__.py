"""Draws the page: map, drone, numbers and plots."""
