"""Measures the page's smoothness.

Command: `python -m benchmarks.pictures.viewer_smoothness [--speed "10 ×"]`.

Flies `complex` on the page in a browser with software rendering, on this machine. Prints the speed
reached, the rate of updates, the frame rate, and the share of a core of each process. On a busy
machine only these shares are meaningful.
"""

import argparse
import os
import time
from pathlib import Path

from benchmarks.pictures.browser import choose, number, simulator_page

WARM_UP_MS, MEASURED_S = 4000, 10.0
WORLD, MISSION = "complex", "building"
"""A flight of six minutes, so that it does not end during the measurement."""
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
    parser.add_argument("--speed", default="10 ×", help="a speed of the page's dropdown")
    options = parser.parse_args()
    received = [0]
    with simulator_page(1100, 640, WORLD) as page:
        page.on("websocket", lambda socket: socket.on("framereceived", lambda _: count(received)))
        page.reload()
        page.get_by_role("button", name="Start").wait_for()
        choose(page, "kind", MISSION)
        choose(page, "speed", options.speed)
        page.get_by_role("button", name="Start").click()
        while number(page, "time") <= 0:
            page.wait_for_timeout(100)
        page.wait_for_timeout(WARM_UP_MS)
        before, began_s, first_s = received[0], time.monotonic(), number(page, "time")
        cpu_before_s = cpu_s()
        drawn_hz = page.evaluate(FRAMES, MEASURED_S)
        passed_s = time.monotonic() - began_s
        flown_s = number(page, "time") - first_s
        updates_hz = (received[0] - before) / passed_s
        cores = {who: (spent - cpu_before_s[who]) / passed_s for who, spent in cpu_s().items()}
    print(f"requested          {options.speed}real time, load {os.getloadavg()[0]:.1f}")
    print(f"flown at           {flown_s / passed_s:.1f} × real time")
    print(f"updates received   {updates_hz:.1f} a second")
    print(f"frames drawn       {drawn_hz:.1f} a second")
    for who, share in cores.items():
        print(f"{who:18} {share:.0%} of a core")


def count(received: list[int]) -> None:
    received[0] += 1


def cpu_s() -> dict[str, float]:
    """CPU time so far of the page's process, the flight's and the browser's, s."""
    spent = {"the page": 0.0, "the flight": 0.0, "the browser": 0.0}
    for process in started_by(os.getpid()):
        whole = sum(map(own_cpu_s, [process, *descendants(process)]))
        if b"sitl" in Path(f"/proc/{process}/cmdline").read_bytes():
            spent["the page"] = own_cpu_s(process)
            spent["the flight"] = whole - spent["the page"]
        else:
            spent["the browser"] += whole
    return spent


def own_cpu_s(process: int) -> float:
    """CPU time in user and kernel mode, s; see proc(5)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def started_by(process: int) -> list[int]:
    tasks = Path(f"/proc/{process}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def descendants(process: int) -> list[int]:
    children = started_by(process)
    return children + [later for child in children for later in descendants(child)]


if __name__ == "__main__":
    main()
