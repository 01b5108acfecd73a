"""One module a chip or sensor: its registers, its frames, and what its values mean."""
