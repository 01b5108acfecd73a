"""Serves the page and checks who may open it."""
