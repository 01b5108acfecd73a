"""Flies what the page asks for, in a process of its own."""
