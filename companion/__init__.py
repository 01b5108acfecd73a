"""What runs on the drone: sensors in, a floor plan and velocity setpoints out."""
