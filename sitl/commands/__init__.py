"""Implements the simulator's command line."""
