"""Compares mapped with true areas of rooms: `python -m benchmarks.mapping.room_areas [WORLD ...]`.

Prints the figures of docs/exports.md. The true area is the floor between the walls, including the
floor under furniture. Rooms are matched by size.
"""

import argparse
from pathlib import Path

from companion.export.plan.survey import survey
from sitl.testing import Sitl

AREAS_M2: dict[str, tuple[float, ...]] = {
    "room_100": (100.0,),
    "room_200": (200.0,),
    "room_300": (300.0,),
    "unusual": (108.1,),
    "two_room_300": (149.25, 149.25),
    "three_room_450": (149.25, 149.25, 148.5),
    "complex": (77.05, 71.1, 35.4, 34.2, 29.45),
    "office": (89.4, 69.4),
}
"""True areas by world, the largest first, m²."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=list(AREAS_M2))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for world in options.worlds:
        areas_m2 = AREAS_M2[world]
        mission = "room" if len(areas_m2) == 1 else "building"
        rooms = survey(Sitl(Path()).fly(world, mission=mission, seed=options.seed).plan).rooms
        print(f"{world}: {len(rooms)} of {len(areas_m2)} rooms")
        for room, true_m2 in zip(rooms, areas_m2, strict=False):
            off = 100 * (room.area_m2 / true_m2 - 1)
            print(f"  {room.area_m2:.2f} m² of {true_m2:.2f} m², {off:+.1f} %", flush=True)


if __name__ == "__main__":
    main()
