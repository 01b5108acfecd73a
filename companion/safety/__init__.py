"""What limits every velocity, and what decides that the drone holds or lands.

    ranges ─► fold_back ─► obstacle_memory ─┬─ obstacle_points: what beams met
                                            └─ seen_free: where beams have gone
                                                   │
    setpoint of a mission ─► velocity_guard ◄──────┘ ─► setpoint for the autopilot

`mapped_obstacles` adds what only the map knows. `preflight` refuses to arm; `health` finds faults.
"""
