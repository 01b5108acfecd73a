"""Opens the simulator's page in a browser, for benchmarks."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Page, sync_playwright

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
END_TIMEOUT_S = 20
DEADLINE_MS = 60_000


@contextmanager
def simulator_page(width_px: int, height_px: int, world: str) -> Iterator[Page]:
    """`sitl view WORLD` in an open page."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise SystemExit("Chromium is missing; on Debian: apt install chromium")
    command = [sys.executable, "-m", "sitl", "view", world, "--port", "0", "--no-browser"]
    served = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert served.stdout is not None
        address = re.search(r"http://\S+", served.stdout.readline())
        assert address is not None, "sitl view did not start"
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
            page = browser.new_page(viewport={"width": width_px, "height": height_px})
            page.set_default_timeout(DEADLINE_MS)
            page.goto(address[0])
            page.get_by_role("button", name="Start").wait_for()
            yield page
            browser.close()
    finally:
        served.terminate()
        served.wait(END_TIMEOUT_S)


def choose(page: Page, label: str, option: str) -> None:
    """Choose an option in a dropdown."""
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option, exact=True).click()


def number(page: Page, name: str) -> float:
    """A number in the page's table; 0 if it is missing."""
    cells = page.locator("tr", has=page.get_by_text(name, exact=True)).locator("td")
    found = re.search(r"-?\d+(\.\d+)?", cells.nth(1).inner_text()) if cells.count() else None
    return float(found[0]) if found else 0.0
