"""Limits every velocity, and detects faults for which the drone holds or lands.

    ranges ─► fold_back ─► obstacle_memory ─┬─ obstacle_points: recent obstacles
                                            └─ swept_space: space swept by beams
                                                   │
    setpoint of a mission ─► velocity_guard ◄──────┘ ─► setpoint for the autopilot

`mapped_obstacles` adds older obstacles from the map. `preflight` checks the vehicle before arming.
`health` detects faults.
"""
