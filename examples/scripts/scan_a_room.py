"""Take off, scan the room, return, and write the map as DXF and PNG.

With the simulator (`sitl run room_100`, in another terminal):

    python examples/scripts/scan_a_room.py --link udpin:127.0.0.1:14550 --bus sitl://127.0.0.1:5790
"""

import argparse
from pathlib import Path

from companion import connect


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", help="the companion's TOML file")
    parser.add_argument("--link", help="address of the autopilot")
    parser.add_argument("--bus", help="address of the sensors")
    parser.add_argument("--out", type=Path, default=Path("out"))
    options = parser.parse_args()
    with connect(options.config, link=options.link, bus=options.bus, out=options.out) as drone:
        drone.take_off()
        drone.scan_room()
        drone.go_home()
        drone.land()
        walls = drone.map().walls
        print(f"{len(walls)} walls, {sum(wall.length_m for wall in walls):.1f} m in all")
        drone.export(options.out / "room.dxf")
        drone.export(options.out / "room.png")


if __name__ == "__main__":
    main()
