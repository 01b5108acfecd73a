"""MAVLink to the autopilot: transports, firmware, and the companion's view of the vehicle."""
