"""Chips and sensors, one module each: registers, frames, and conversion of values."""
