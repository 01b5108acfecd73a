"""Scores map and flight against the ground truth."""
