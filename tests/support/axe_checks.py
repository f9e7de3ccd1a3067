"""What axe finds on a page that keeps people out."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Page

AXE = Path(__file__).parents[2] / ".ci" / "page" / "node_modules" / "axe-core" / "axe.min.js"
FOUND = """async () => (await axe.run(document, { resultTypes: ["violations"] })).violations
    .filter(({ impact }) => ["serious", "critical"].includes(impact))
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" ")}`)"""


def with_axe(page: Page) -> None:
    """Load axe, which is fetched with the other checks of the page, by .ci/page/check."""
    if AXE.is_file():
        page.evaluate(AXE.read_text(encoding="utf-8"))


def keeps_out(page: Page) -> list[str]:
    """What axe finds that keeps people out who see little, or use no mouse."""
    if not AXE.is_file():
        return []
    found: list[str] = page.evaluate(FOUND)
    return found
