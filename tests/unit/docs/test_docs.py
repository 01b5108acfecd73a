"""Documentation: links as on GitHub, and the navigation of the site.

`make docs` checks links between pages, anchors and the names of the API. These tests also check
links to images, samples and sources, and that the navigation contains every page.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import companion

PROJECT = Path(__file__).parents[3]
DOCS = PROJECT / "docs"
PAGES = [*sorted(PROJECT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
FENCE = re.compile(r"^ *```.*?^ *```", re.M | re.S)
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+?)\s*$", re.M)


def text_of(page: Path) -> str:
    """A page without its code blocks."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def anchors(page: Path) -> set[str]:
    """GitHub's anchors: lower case, without punctuation, with hyphens for spaces."""
    titles = (LINK.sub("]", heading) for heading in HEADING.findall(text_of(page)))
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken(page: Path) -> Iterator[str]:
    for link in LINK.findall(text_of(page)):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            yield f"{link}: no such file"
        elif anchor and anchor not in anchors(target):
            yield f"{link}: no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(PROJECT)))
def test_every_link_has_a_target(page: Path) -> None:
    assert list(broken(page)) == []


def pages_in(entry: Any) -> Iterator[Path]:
    """The pages of an entry of docs/nav.yml, including the matches of a glob."""
    match entry:
        case str(path):
            yield PROJECT / path
        case {"glob": pattern}:
            yield from PROJECT.glob(pattern)
        case list(entries):
            for one in entries:
                yield from pages_in(one)
        case dict(titled):
            for one in titled.values():
                yield from pages_in(one)


def test_the_navigation_has_every_page_once() -> None:
    """A new page needs a line in docs/nav.yml."""
    nav = yaml.safe_load((DOCS / "nav.yml").read_text(encoding="utf-8"))["nav"]
    assert sorted(pages_in(nav)) == sorted(PAGES)


def test_the_api_page_has_every_public_name() -> None:
    listed = re.findall(r"^ +- (\w+)$", (DOCS / "api/companion.md").read_text("utf-8"), re.M)
    assert sorted(listed) == sorted(companion.__all__)
