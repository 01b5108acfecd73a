"""The emulated autopilot's estimate of its own motion, and its reports."""
