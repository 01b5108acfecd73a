"""Runs a flight as a process: control loop, hardware, clocks, console, recovery."""
