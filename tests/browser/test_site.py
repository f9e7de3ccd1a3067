"""axe finds nothing on the pages of the manual, and the field card is two sheets of paper."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import Browser

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build" / "site"
EXAMPLES = ROOT / "docs" / "examples"
AXE = ROOT / ".ci" / "page" / "node_modules" / "axe-core" / "axe.min.js"
FOUND = """async () => (await axe.run(document, { resultTypes: ["violations"] })).violations
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 160)).join(" ")}`)"""
PAGES = (
    *(
        "index",
        "start",
        "install",
        "glossary",
        "accuracy",
        "messages",
        "field-card",
        "example-files",
        "search",
    ),
    *("howto/accident-scene", "howto/python", "background/conventions", "background/likelihood"),
    *("reference/tables", "reference/made/project", "reference/made/commands"),
    *("reference/made/python", "reference/made/results"),
)


@pytest.mark.skipif(not (SITE / "index.html").is_file(), reason="no site: .ci/site/build makes it")
@pytest.mark.skipif(not AXE.is_file(), reason="no axe: .ci/page/check fetches it")
def test_axe_finds_nothing_on_the_site(chromium: Browser) -> None:
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    script = AXE.read_text(encoding="utf-8")
    found = {}
    for name in PAGES:
        page.goto((SITE / f"{name}.html").as_uri())
        page.evaluate(script)
        if violations := page.evaluate(FOUND):
            found[name] = violations
    page.close()

    assert found == {}


@pytest.mark.skipif(not (SITE / "index.html").is_file(), reason="no site: .ci/site/build makes it")
def test_what_the_site_offers_to_print_or_to_save_is_in_it() -> None:
    card = SITE / "field-card-to-print.html"
    (link,) = re.findall(r'<a href="([^"]+)">Open the field card', _page("field-card"))
    (archive,) = SITE.rglob("uavgram-examples.zip")
    scripts = {f"uavgram-examples/docs/examples/{path.name}" for path in EXAMPLES.glob("*.*")}

    assert SITE / link == card
    assert card.read_bytes() == (ROOT / "docs" / card.name).read_bytes()
    assert "uavgram-examples.zip" in _page("example-files")
    with zipfile.ZipFile(archive) as held:
        names = set(held.namelist())
    assert scripts < names
    for name in ("photo_poses", "lengths_only", "plan", "single_photo", "project"):
        assert f"uavgram-examples/configs/{name}.yaml" in names
    assert not [name for name in names if "/out/" in name or "__pycache__" in name]


@pytest.mark.skipif(not (SITE / "index.html").is_file(), reason="no site: .ci/site/build makes it")
def test_no_link_in_the_text_of_a_page_leads_to_that_page() -> None:
    for path in SITE.rglob("*.html"):
        text = path.read_text(encoding="utf-8").partition("<article")[2].partition("</article>")[0]
        assert f'href="{path.name}"' not in text, path


def _page(name: str) -> str:
    return (SITE / f"{name}.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("paper", ["A4", "Letter"])
def test_the_field_card_is_two_sheets(paper: str, chromium: Browser, tmp_path: Path) -> None:
    page = chromium.new_page()
    page.goto((ROOT / "docs" / "field-card-to-print.html").as_uri())
    pdf = page.pdf(format=paper, prefer_css_page_size=False)
    page.close()
    (tmp_path / "card.pdf").write_bytes(pdf)

    assert pdf.count(b"/Type /Page\n") == 2
