"""Take off, print the front range for some seconds, and land.

Leaving the `with` block lands the drone, also at Ctrl-C or an error. With the simulator
(`sitl run room_100`, in another terminal):

    python examples/scripts/look_around.py
"""

import argparse
import time

from companion import Beam, connect


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--link", default="udpin:127.0.0.1:14550")
    parser.add_argument("--bus", default="sitl://127.0.0.1:5790")
    parser.add_argument("--times", type=int, default=10)
    options = parser.parse_args()
    with connect(link=options.link, bus=options.bus, settings={"mission.height_m": 1.0}) as drone:
        drone.take_off()
        for _ in range(options.times):
            reading = drone.readings[Beam.FRONT]
            print(f"front: {reading.distance_m:.2f} m" if reading.is_distance else "front: –")
            time.sleep(0.5)
    print(drone.activity)


if __name__ == "__main__":
    main()
