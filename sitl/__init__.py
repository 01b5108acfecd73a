"""Everything needed to fly the companion on a laptop: world, vehicle, autopilot, sensors, score."""

import companion  # noqa: F401 - its word on threads comes before numpy is loaded
