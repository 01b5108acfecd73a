"""Emulates the flight controller.

    MAVLink in ─► core ─► commands, modes, parameters, streams ─► MAVLink out
                   │
                   ├─► control: velocity setpoint ──► vehicle
                   └─◄ estimator: drifting flow odometry ◄──┘

`ardupilot` and `px4` implement the differences between the firmwares, behind `firmware`: mode
numbers, results, texts, setpoint frames, setpoint timeout. `parameters` has their parameters.
"""
