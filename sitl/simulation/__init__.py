"""The world at one moment and how it moves on: vehicle, noise, radio, truth."""
