"""Checks before the first flight: self-test, wiring, calibration."""
