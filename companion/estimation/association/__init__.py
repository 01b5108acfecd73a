"""Assigns hits to walls, and detects, merges and prunes walls."""
