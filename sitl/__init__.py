"""Simulator for flying the companion on a laptop: world, vehicle, autopilot, sensors, score."""

import companion  # noqa: F401 - limits numpy's threads, so it must be imported before numpy
