"""Simulates the drone's sensors, from physics up to the registers that the drivers read.

true range ─► beam ─► sharp ─► volts ─► ads1115 ─┐
true rate ──► lsm9ds1 ───────────────────────────┴─► i2c bus ─► drivers (in process, or by server)
"""
