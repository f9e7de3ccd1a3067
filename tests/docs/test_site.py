"""The manual as a site, which `.ci/site/build` makes: no dead link, nothing from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build" / "site"
LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}

pytestmark = pytest.mark.skipif(
    not (SITE / "index.html").is_file(), reason="no site: .ci/site/build makes it"
)


class Found(HTMLParser):
    """What a page loads, links to and can be linked at.

    Attributes
    ----------
    loads, links
        Addresses of scripts, styles and pictures; and of other pages.
    places
        Anchors.
    """

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.places.add(values.get("id", ""))
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif tag in LOADED and LOADED[tag] in values:
            is_about = tag == "link" and values.get("rel") in ("index", "search", "next", "prev")
            (self.links if is_about else self.loads).append(values[LOADED[tag]])


@cache
def found_in(path: Path) -> Found:
    found = Found()
    found.feed(path.read_text(encoding="utf-8"))
    return found


def pages() -> Iterator[Path]:
    return (path for path in sorted(SITE.rglob("*.html")) if "_static" not in path.parts)


def test_no_page_asks_elsewhere() -> None:
    loads = {(path.name, one) for path in pages() for one in found_in(path).loads}
    styles = "".join(path.read_text(encoding="utf-8") for path in SITE.rglob("*.css"))

    assert len(loads) > 100
    assert {one for one in loads if re.match(r"(https?:)?//", one[1])} == set()
    assert re.findall(r"url\(['\"]?(?:https?:)?//[^)]+|@import[^;]+", styles) == []


def test_every_link_leads_somewhere() -> None:
    dead = set()
    count = 0
    for path in pages():
        for link in (*found_in(path).links, *found_in(path).loads):
            if re.match(r"[a-z]+:", link):
                continue
            count += 1
            name, place = urldefrag(link.split("?")[0] if "?" in link else link)
            target = (path.parent / unquote(name)).resolve() if name else path
            is_place = target.suffix != ".html" or unquote(place) in found_in(target).places | {""}
            if not target.is_file() or not is_place:
                dead.add((path.relative_to(SITE).as_posix(), link))

    assert count > 1000
    assert dead == set()


def test_pages_that_the_program_writes_are_on_the_site() -> None:
    made = SITE / "reference" / "made"

    assert "uavgram picks match" in (made / "commands.html").read_text(encoding="utf-8")
    assert "ground.roughness_sigma_m" in (made / "project.html").read_text(encoding="utf-8")
    assert "uavgram.load_results" in (made / "python.html").read_text(encoding="utf-8")
