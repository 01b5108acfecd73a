"""Opens pages in a real browser for system tests."""

import math
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from benchmarks.pictures.browser import FLAGS
from companion.view.scene.camera import PANEL_PX
from tests.processes.started import read_until, started, stop
from tests.waiting import DEADLINE_S

CHROMIUM = "chromium"
NO_NOTIFICATIONS = ".mantine-Notifications-root { display: none }"
"""Hides notifications: they cover the scene, and their size depends on fonts."""
SIZE = {"width": 1000, "height": 480}
expect.set_options(timeout=1000 * DEADLINE_S)


@contextmanager
def chromium() -> Iterator[Browser]:
    """Chromium; the test is skipped with a reason if it is missing."""
    path = shutil.which(CHROMIUM)
    if path is None:
        pytest.skip("Chromium is missing; on Debian: apt install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def served(command: list[str]) -> Iterator[str]:
    """The address that a command prints; on interruption the command must exit with 0."""
    with started(command) as process:
        output = read_until(process, "http://")
        address = re.search(r"http://\S+", output)
        assert address is not None
        yield address[0]
        stop(process)
        assert process.returncode == 0


@contextmanager
def opened(browser: Browser, address: str) -> Iterator[Page]:
    """A page; fails if errors are in its console."""
    errors: list[str] = []
    with browser.new_context(viewport=SIZE, accept_downloads=True) as context:  # type: ignore[arg-type]
        page = context.new_page()
        page.set_default_timeout(1000 * DEADLINE_S)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on(
            "console",
            lambda message: errors.append(message.text) if message.type == "error" else None,
        )
        page.goto(address)
        yield page
    assert not errors


def number(page: Page, name: str) -> float:
    """The first number in a row of the table; NaN without a number."""
    found = re.search(r"-?\d+(\.\d+)?", row(page, name).split(",")[-1])
    return float(found[0]) if found else math.nan


def row(page: Page, name: str) -> str:
    """The text beside a name in the table of numbers; empty if the name is missing."""
    cells = _cells(page, name)
    return cells.nth(1).inner_text() if cells.count() else ""


def has_row(page: Page, name: str) -> bool:
    return _cells(page, name).count() > 0


def _cells(page: Page, name: str) -> Locator:
    return page.locator("tr", has=page.get_by_text(name, exact=True)).locator("td")


def text_field(page: Page, label: str) -> Locator:
    named = page.locator("label").filter(has_text=re.compile(f"^{re.escape(label)}$"))
    return named.locator("xpath=following::input[not(@type='hidden')][1]")


def press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def unfold(page: Page, folder: str) -> None:
    """Open a folded part of a panel."""
    page.get_by_text(folder, exact=True).click()


def coloured(page: Page, from_share: float, to_share: float) -> int:
    """Number of coloured pixels in a part of the scene, from left (0) to right (1)."""
    width = SIZE["width"] - 2 * PANEL_PX
    x = PANEL_PX + from_share * width
    clip = {"x": x, "y": 0, "width": (to_share - from_share) * width, "height": SIZE["height"]}
    shot = Image.open(BytesIO(page.screenshot(clip=clip, style=NO_NOTIFICATIONS)))  # type: ignore[arg-type]
    pixels = np.asarray(shot.convert("RGB")).astype(int)
    return int((np.ptp(pixels, axis=2) > 40).sum())
