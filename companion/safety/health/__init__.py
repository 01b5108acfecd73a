"""Whether what comes in can be believed, and whether the drone is well enough to fly on.

time ─────► does the loop come round in time? else nothing of the rest is judged
odometry ─► steady: without its jumps
gyro ─────► bridged where samples are missing; saturated? does it turn as the autopilot does?
ranges ───► stuck and noisy ones have failed; do they look where they should?
│
└─► the fault, if there is one: the flight holds, or lands
"""
