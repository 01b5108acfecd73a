"""Take off, fly a square of four places, look along each side, and land where it began.

The planner leads the drone round obstacles. A place that is not free, or not reachable, raises an
error that says why. With the simulator (`sitl run room_100`, in another terminal):

    python examples/scripts/fly_a_square.py
"""

import argparse
import math

from companion import NotCompletedError, connect


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--link", default="udpin:127.0.0.1:14550")
    parser.add_argument("--bus", default="sitl://127.0.0.1:5790")
    parser.add_argument("--side", type=float, default=2.0, help="side of the square, m")
    options = parser.parse_args()
    side_m = options.side
    corners = (side_m, 0.0), (side_m, side_m), (0.0, side_m), (0.0, 0.0)
    with connect(link=options.link, bus=options.bus) as drone:
        drone.take_off()
        for number, (north_m, east_m) in enumerate(corners, start=1):
            try:
                drone.fly_to(north_m, east_m, yaw_rad=number * math.pi / 2, timeout_s=60)
            except NotCompletedError as error:
                print(f"corner {number}: {error}")
                continue
            pose = drone.pose
            if pose is not None:
                print(f"corner {number}: {pose.north_m:.1f} m north, {pose.east_m:.1f} m east")
        drone.land()
    print(drone.activity)


if __name__ == "__main__":
    main()
