"""Rooms and buildings.

    TOML file ─► format ─► World ─► mesh ─► triangles ─► model (FCL): ranges, clearance
                             └────► plan: the true walls seen from above, for the scorer

The world's frame is NED with the floor at down = 0; files give heights upwards.
"""
