"""The map: from wall lines and hits to a floor plan, and files of it that other programs open."""
