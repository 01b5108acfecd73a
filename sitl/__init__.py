"""Everything needed to fly the companion on a laptop: world, vehicle, autopilot, sensors, score."""
