"""What can be done to a simulation: faults, the pilot, people; one module a kind."""
