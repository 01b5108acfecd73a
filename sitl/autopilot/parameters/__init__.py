"""Emulates the autopilots' parameters and parameter protocols.

`table` reads the parameters of each firmware from `ardupilot.csv` and `px4.csv`: facts of
ArduCopter 4.6 and PX4 1.17. `protocol` has the common part of the protocols; `ardupilot` and `px4`
have the differences.
"""
