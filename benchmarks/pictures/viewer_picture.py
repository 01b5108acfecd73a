"""Takes the pictures of the page in README.

Command: `python -m benchmarks.pictures.viewer_picture [--drones 2] [--out FILE]`.

They show the exploration of a building, by one drone in viewer.png and by two in team.png, in a
browser with software rendering; each takes some minutes.
"""

import argparse
from pathlib import Path

from benchmarks.pictures.browser import choose, number, simulator_page

WIDTH_PX, HEIGHT_PX = 1600, 800
WORLD = "two_room_300"
AT_S = {1: 215.0, 2: 130.0}
"""Time of the picture in the flight, s, by the number of drones: both rooms are mapped, and the
drones are still flying."""
FILES = {1: Path("docs/images/viewer.png"), 2: Path("docs/images/team.png")}
POLL_MS = 300
SETTLE_MS = 20_000
"""Time for a browser without a GPU to draw everything, ms."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drones", type=int, choices=AT_S, default=1)
    parser.add_argument("--out", type=Path, help="default: the picture in docs/images")
    parser.add_argument("--world", default=WORLD)
    parser.add_argument("--at", type=float, help="time in the flight, s")
    options = parser.parse_args()
    at_s, out = options.at or AT_S[options.drones], options.out or FILES[options.drones]
    with simulator_page(WIDTH_PX, HEIGHT_PX, options.world) as page:
        choose(page, "kind", "building")
        choose(page, "speed", "all")
        for drones in range(2, options.drones + 1):
            page.get_by_role("button", name="Add UAV").click()
            page.get_by_text("on its pad").nth(drones - 1).wait_for()
        page.get_by_role("button", name="Start").click()
        while number(page, "time") < at_s:
            page.wait_for_timeout(POLL_MS)
        page.get_by_role("button", name="Pause").click()
        page.add_style_tag(content=".mantine-Notification-root { display: none }")
        page.wait_for_timeout(SETTLE_MS)
        page.mouse.move(WIDTH_PX / 2, HEIGHT_PX - 5)
        page.screenshot(path=out)
    print(f"wrote {out}")


if __name__ == "__main__":
    main()
