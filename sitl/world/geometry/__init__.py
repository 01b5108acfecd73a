"""Computes with triangles, rays and distances."""
