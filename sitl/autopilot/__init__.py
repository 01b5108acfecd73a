"""The emulated flight controller.

    MAVLink in ─► core ─► commands, modes, parameters, streams ─► MAVLink out
                   │
                   ├─► control: what velocity to fly now ─► vehicle
                   └─◄ estimator: drifting flow odometry ◄──┘

`ardupilot` holds what is particular to ArduCopter: mode numbers, answers and texts.
"""
