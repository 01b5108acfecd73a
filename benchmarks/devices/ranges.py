"""Measures range queries in worlds of growing size: `python -m benchmarks.devices.ranges`.

Prints the median time of one five-ray scan and the time to build the world. Compare the times of
world sizes within one run.
"""

import math
import random
import statistics
import time

from sitl.world.format import World
from sitl.world.geometry.model import WorldModel

SIZES = (12, 100, 1000, 5000)
SCANS = 2000
TRIANGLES_A_BOX = 12


def hall(triangles: int) -> World:
    """A hall with enough pillars for that many triangles."""
    noise = random.Random(1)
    boxes = [
        {
            "corner": (noise.uniform(0, 39), noise.uniform(0, 39)),
            "size": (0.3, 0.3),
            "top_m": noise.uniform(0.5, 2.6),
        }
        for _ in range(max(0, triangles - 12) // TRIANGLES_A_BOX)
    ]
    return World.model_validate(
        {
            "name": f"hall of {triangles}",
            "height_m": 2.6,
            "walls": [{"points": [(0, 0), (40, 0), (40, 40), (0, 40)], "closed": True}],
            "boxes": boxes,
            "starts": [{"name": "middle", "position": (20, 20)}],
        }
    )


def main() -> None:
    for size in SIZES:
        world = hall(size)
        began_s = time.perf_counter()
        model = WorldModel(world)
        built_ms = 1e3 * (time.perf_counter() - began_s)
        noise = random.Random(2)
        times_us = []
        for _ in range(SCANS):
            origin = (noise.uniform(1, 39), noise.uniform(1, 39), -1.2)
            yaw = noise.uniform(-math.pi, math.pi)
            began_s = time.perf_counter()
            for quarter in range(3):
                bearing = yaw + quarter * math.pi / 2
                model.range_m(origin, (math.cos(bearing), math.sin(bearing), 0.0), 6.0)
            model.range_m(origin, (0.0, 0.0, -1.0), 6.0)
            model.range_m(origin, (0.0, 0.0, 1.0), 6.0)
            times_us.append(1e6 * (time.perf_counter() - began_s))
        print(
            f"{size:5d} triangles: five rays {statistics.median(times_us):6.1f} µs median, "
            f"built in {built_ms:6.1f} ms"
        )


if __name__ == "__main__":
    main()
