"""Flights: in lockstep, in two processes, served to others, several vehicles at once."""
