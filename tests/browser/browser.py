"""Opens pages in a real browser for system tests."""

import math
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from benchmarks.pictures.browser import FLAGS
from companion.view.scene.camera import PANEL_PX
from tests.processes.started import read_until, started, stop
from tests.waiting import DEADLINE_S, until

CHROMIUM = "chromium"
NO_NOTIFICATIONS = ".mantine-Notifications-root { display: none }"
"""Hides notifications: they cover the scene, and their size depends on fonts."""
SIZE = {"width": 1000, "height": 480}
SIZES = {"laptop": (1280, 720), "desktop": (1920, 1080), "phone": (390, 844)}
"""Windows in which each state of a page is looked at, pixels."""
BOXES = """elements => elements.map(element => {
    const box = element.getBoundingClientRect();
    return [box.left, box.top, box.right, box.bottom];
})"""
DROP = """([name, text]) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([text], name));
    document.body.dispatchEvent(new DragEvent("drop", {dataTransfer, bubbles: true}));
}"""
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
        assert process.returncode == 0, output


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


def looked_at(page: Page, state: str, folder: Path, *shown: str) -> None:
    """Take a picture of the page in each size; fails if a text of `shown` is not in its window.

    Of a window wider than a phone at least half shows the scene.
    """
    for name, (width_px, height_px) in SIZES.items():
        page.set_viewport_size({"width": width_px, "height": height_px})
        until(partial(_is_laid_out, page, shown), f"the layout on a {name}")
        page.screenshot(path=folder / f"{state}_{name}.png", style=NO_NOTIFICATIONS)
    page.set_viewport_size(SIZE)  # type: ignore[arg-type]


def _is_laid_out(page: Page, shown: Sequence[str]) -> bool:
    width_px, _ = _window_px(page)
    has_room = width_px == SIZES["phone"][0] or scene_px(page) >= width_px // 2 - 20
    return has_room and all(is_in_window(page, text) for text in shown)


def is_in_window(page: Page, text: str) -> bool:
    """True if one of the elements with this text is entirely in the window."""
    width_px, height_px = _window_px(page)
    boxes = page.get_by_text(text, exact=True).evaluate_all(BOXES)
    return any(
        0 <= left < right <= width_px and 0 <= top < bottom <= height_px
        for left, top, right, bottom in boxes
    )


def _window_px(page: Page) -> tuple[int, int]:
    width_px, height_px = page.evaluate("[innerWidth, innerHeight]")
    return width_px, height_px


def scene_px(page: Page) -> float:
    """Width of the scene between the panels, pixels."""
    boxes = [page.get_by_text(text, exact=True).first.bounding_box() for text in ("Start", "Plan")]
    left, right = boxes
    return right["x"] - left["x"] - left["width"] if left and right else 0.0


def overlapping(page: Page, selector: str) -> int:
    """Number of pairs of elements that lie on each other."""
    boxes = np.array(page.locator(selector).evaluate_all(BOXES)).reshape(-1, 4)
    before = boxes[:, None, :2] < boxes[None, :, 2:]
    return int(np.triu((before & before.swapaxes(0, 1)).all(axis=2), 1).sum())


def drop(page: Page, name: str, text: str) -> None:
    """Drop a file on the page."""
    page.evaluate(DROP, [name, text])


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
