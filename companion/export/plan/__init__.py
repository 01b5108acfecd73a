"""The floor plan as a drawing: sheet, dimensions, DXF, areas."""
