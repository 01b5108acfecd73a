"""Flight recorder: stores inputs and results of a flight in files of common formats."""
