"""Solves the whole flight as one least-squares problem: state, factors and solver."""
