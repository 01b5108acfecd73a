"""What the page shows: the map, the drone, numbers and plots."""
