"""The world at one moment and how it moves on; a flight in lockstep with it."""
