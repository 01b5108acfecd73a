"""The whole flight as one least-squares problem: its state, factors and solver."""
