"""What the autopilots can be set to.

`table` reads the parameters of each firmware from `ardupilot.csv` and `px4.csv`: facts of
ArduCopter 4.6 and PX4 1.17. `protocol` is what their parameter protocols have in common,
`ardupilot` and `px4` what each does in its own way.
"""
