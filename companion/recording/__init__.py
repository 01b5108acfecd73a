"""The flight recorder: what came in and what came of it, as files that other programs open too."""
