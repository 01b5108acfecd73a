"""Actions on a simulation: faults, pilot, people; one module per kind."""
