"""Our world for an autopilot that simulates its own flight, such as ArduPilot SITL or PX4 SIH.

    autopilot ──SIM_STATE or HIL_STATE_QUATERNION──► truth ─► ranges, gyro ─► bus ─► companion
        ▲ ▲                                            │
        │ └─── ODOMETRY, DISTANCE_SENSOR, parameters
        └───── MAVLink, on a link of its own ───────────────────────────────────── companion

`tracker` follows the true state, `feed` is what the autopilot is given, `setup` what it is
configured with, `vehicle` puts them together behind the interface that the server serves.
"""
