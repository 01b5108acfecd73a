"""Perpendicular Distance and Parallel Scanning: what the drone does next.

Pure state machines: they take what is known at this tick and return the next state and what to
ask of the autopilot. `flight` is the whole flight from connection to landing, `room_scan` the
tracing of one room, `explore` the seeing of a building and `layers` of its heights. `travel` gets
to a place, along a way that `route` finds and `follow` flies; `gaps` says what is still unseen.
`guard` has the last word on every velocity. `perpendicular` finds the nearest wall in a 360°
turn, `standoff` how far to keep from it, `control` holds the few control laws. None of them does
I/O or reads a clock.
"""
