"""Draws the floor plan, once for CAD, paper and pictures.

    map ─► rooms and openings (survey, jambs) ─► turned ─┐
                      building and furniture (building) ─┴─► drawing ─┬─► figure ─► sheet, map.png
        borders of an unfinished map (unseen), labels, room names  ───┘└► dxf

`sheet` writes SVG and PDF, `export/dxf` writes DXF, and `export/map_png.py` the picture of every
flight.
"""
