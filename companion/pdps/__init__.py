"""Missions of PDPS (Perpendicular Distance and Parallel Scanning), as pure state machines.

Each takes the input of one tick and returns the next state and the action to request from the
autopilot. None does I/O or reads a clock.

    flight ─┬─► room_scan: traces the walls of one room, after `perpendicular` found the nearest
            ├─► explore: maps a building; `frontiers` finds unseen cells, `viewpoints` and
            │            `visibility` the places to see them from, `tour` the order of these
            ├─► layers: maps a building at several heights, then runs `overflight`
            └─► home
"""
