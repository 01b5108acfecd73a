"""Perpendicular Distance and Parallel Scanning: the missions.

Pure state machines: they take what is known at this tick and return the next state and what to
ask of the autopilot. None of them does I/O or reads a clock.

    flight ─┬─► room_scan: the tracing of one room, begun by `perpendicular`
                   ├─► explore: the seeing of a building: `frontiers` says what is unseen,
                   │            `viewpoints` and `visibility` from where to see it, `tour` in
                   │            which order
                   ├─► layers: a building at several heights; `overflight` from above
                   └─► home
"""
