"""State machine of the whole flight; `phases` has its diagram."""
