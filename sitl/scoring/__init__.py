"""How good the map and the flight were, against the truth."""
