"""MAVLink to the autopilot: transports, dialects, and the companion's view of the vehicle."""
