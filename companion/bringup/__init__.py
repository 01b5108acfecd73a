"""Before the first flight: self-test, wiring, calibration."""
