"""Triangles, rays and distances."""
