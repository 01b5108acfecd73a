"""The emulated flight controller.

    MAVLink in ─► core ─► commands, modes, parameters, streams ─► MAVLink out
                   │
                   ├─► control: what velocity to fly now ─► vehicle
                   └─◄ estimator: drifting flow odometry ◄──┘

`ardupilot` and `px4` hold what is particular to each, behind `firmware`: mode numbers, answers,
texts, setpoint frames, what happens when setpoints stop. `parameters` holds theirs.
"""
