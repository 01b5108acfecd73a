"""Validates the inputs of each tick, and detects faults for which the drone holds or lands.

time ─────► is the control loop on time? if not, the inputs are not checked
odometry ─► steady: jumps are removed
gyro ─────► gaps are bridged; is it saturated? does it agree with the autopilot's turn?
ranges ───► stuck and noisy sensors have failed; are the sensors mounted correctly?
│
└─► the first fault, if any: the flight holds or lands
"""
