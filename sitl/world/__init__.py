"""Describes and reads rooms and buildings.

    TOML file ──► format ──┬─► World ─► mesh ─► triangles ─► model (FCL): ranges, clearance
    other files ► importers┘     └────► plan: the true walls seen from above, for the scorer

`loading` finds the file or built-in world for a name.

The world frame is NED with the floor at down = 0. Files give heights, positive upwards.
"""
