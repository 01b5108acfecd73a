"""Takes the picture of the page in README.

Command: `python -m benchmarks.pictures.viewer_picture [--out FILE]`.

It shows the exploration of a building, in a browser with software rendering; takes some minutes.
"""

import argparse
from pathlib import Path

from benchmarks.pictures.browser import choose, number, simulator_page

WIDTH_PX, HEIGHT_PX = 1600, 800
WORLD = "two_room_300"
AT_S = 190.0
"""Time of the picture in the flight, s: both rooms are mapped, and the drone is still flying."""
POLL_MS = 300
SETTLE_MS = 20_000
"""Time for a browser without a GPU to draw everything, ms."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/images/viewer.png"))
    parser.add_argument("--world", default=WORLD)
    parser.add_argument("--at", type=float, default=AT_S, help="time in the flight, s")
    options = parser.parse_args()
    with simulator_page(WIDTH_PX, HEIGHT_PX, options.world) as page:
        choose(page, "kind", "building")
        choose(page, "speed", "all")
        page.get_by_role("button", name="Start").click()
        while number(page, "time") < options.at:
            page.wait_for_timeout(POLL_MS)
        page.get_by_role("button", name="Pause").click()
        page.add_style_tag(content=".mantine-Notification-root { display: none }")
        page.wait_for_timeout(SETTLE_MS)
        page.mouse.move(WIDTH_PX / 2, HEIGHT_PX - 5)
        page.screenshot(path=options.out)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
