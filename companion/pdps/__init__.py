"""Perpendicular Distance and Parallel Scanning: what the drone does next.

Pure state machines: they take what is known at this tick and return the next state and what to
ask of the autopilot. `flight` is the whole flight from connection to landing, `room_scan` the
tracing of one room, `perpendicular` finds the nearest wall in a 360° turn, `control` holds the
few control laws. None of them does I/O or reads a clock.
"""
