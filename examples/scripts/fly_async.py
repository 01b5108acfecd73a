"""Fly with asyncio: telemetry is printed while the drone flies to a place and turns there.

With the simulator (`sitl run room_100`, in another terminal):

    python examples/scripts/fly_async.py
"""

import argparse
import asyncio
import math

from companion import AsyncDrone, connect_async


async def print_activity(drone: AsyncDrone) -> None:
    async for activity in drone.telemetry.activity():
        print(activity)


async def print_walls(drone: AsyncDrone) -> None:
    async for walls in drone.telemetry.walls():
        print(f"{len(walls)} walls, {sum(wall.length_m for wall in walls):.1f} m")


async def fly(link: str, bus: str) -> None:
    async with asyncio.TaskGroup() as tasks, connect_async(link=link, bus=bus) as drone:
        tasks.create_task(print_activity(drone))  # ends with the flight
        tasks.create_task(print_walls(drone))
        await drone.take_off()
        await drone.fly_to(1.0, 0.0)
        await drone.fly_velocity(right_m_s=0.3, seconds=2)
        await drone.fly_velocity(yaw_rate_rad_s=math.radians(30), seconds=6)
        await drone.go_home()
        await drone.land()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--link", default="udpin:127.0.0.1:14550")
    parser.add_argument("--bus", default="sitl://127.0.0.1:5790")
    options = parser.parse_args()
    asyncio.run(fly(options.link, options.bus))


if __name__ == "__main__":
    main()
