"""Runs flights: in lockstep, in two processes, served to others, with several vehicles."""
