"""Odd input, crashes, recordings and recovery."""
