"""What the emulated autopilot knows of its own motion, and tells of it."""
