"""How smooth the page is: `python -m benchmarks.viewer_smoothness [--speed "10 ×"]`.

Flies `room_100` on the page in a browser that renders by software, on this machine, and prints how
fast the flight really went, how often the browser was told something new, and how often it drew.
"""

import argparse
import os
import time

from benchmarks.browser import choose, number, simulator_page

WARM_UP_MS, MEASURED_S = 4000, 10.0
WORLD = "room_100"
FRAMES = """(seconds) => new Promise(done => {
    let frames = 0;
    const began = performance.now();
    const frame = () => {
        frames += 1;
        const passed = (performance.now() - began) / 1000;
        passed < seconds ? requestAnimationFrame(frame) : done(frames / passed);
    };
    requestAnimationFrame(frame);
})"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--speed", default="10 ×", help="as the page has it")
    options = parser.parse_args()
    told = [0]
    with simulator_page(1100, 640, WORLD) as page:
        page.on("websocket", lambda socket: socket.on("framereceived", lambda _: count(told)))
        page.reload()
        page.get_by_role("button", name="Start").wait_for()
        choose(page, "speed", options.speed)
        page.get_by_role("button", name="Start").click()
        while number(page, "time") <= 0:
            page.wait_for_timeout(100)
        page.wait_for_timeout(WARM_UP_MS)
        before, began_s, first_s = told[0], time.monotonic(), number(page, "time")
        drawn_hz = page.evaluate(FRAMES, MEASURED_S)
        passed_s = time.monotonic() - began_s
        flown_s = number(page, "time") - first_s
        updates_hz = (told[0] - before) / passed_s
    print(f"asked for          {options.speed}real time, load {os.getloadavg()[0]:.1f}")
    print(f"flown at           {flown_s / passed_s:.1f} × real time")
    print(f"updates received   {updates_hz:.1f} a second")
    print(f"frames drawn       {drawn_hz:.1f} a second")


def count(told: list[int]) -> None:
    told[0] += 1


if __name__ == "__main__":
    main()
