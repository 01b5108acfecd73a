"""Provides a world for autopilots that simulate their own flight: ArduPilot SITL, PX4 SIH.

    autopilot ──SIM_STATE or HIL_STATE_QUATERNION──► truth ─► ranges, gyro ─► bus ─► companion
        ▲ ▲                                            │
        │ └─── ODOMETRY, DISTANCE_SENSOR, parameters
        └───── MAVLink, on a link of its own ───────────────────────────────────── companion

`tracker` follows the true state. `feed` builds the messages for the autopilot, `setup` configures
it, and `vehicle` combines them behind the interface that the server uses.
"""
