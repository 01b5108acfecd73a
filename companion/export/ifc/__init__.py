"""Writes the building as a BIM model in IFC 4.

    building (plan/building.py) ─┬─► walls with thickness, and doorways in them (walls) ─┐
    openings (plan/survey.py) ───┘                                                      ├─► write
    rooms    (plan/survey.py) ──────────────────────────────────────────────────────────┘

`model` has the calls of IfcOpenShell that several kinds of object need.
"""
