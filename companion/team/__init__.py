"""Drones that fly together: what they tell each other, and what each knows of the others."""
