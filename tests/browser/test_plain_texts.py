"""Texts of the page: no statistics without words for them, and nothing about what is not known."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import wait_until_adjusted
from picking_projects import PickingProject
from picking_server import served
from playwright.sync_api import Page, expect

JARGON = re.compile(
    r"residuals ×|worst w\b|\bw -?\d|\bseed(ed)?\b|to first order|cannot be inverted|[σΣ]"
    r"|[Ss]igma|\badjust"
    r"|Interior orientation|\b[Ff]rames?\b|[Bb]rown lens|without feedback|\b[Uu]?n?matched\b",
)
NOTHING = re.compile(
    r"\b(null|undefined|NaN)\b|[–-] ?(mm?|s|px|°|in|ft|UTC)\b|[–-] ± [–-]|±\s*($|[a-z°])"
)
TERMS = re.compile(
    r"±|misfit|Good to|Uncertainty|Friction|principal point|distortion|folds back|lens$"
)
TEXTS = """() => {
  const seen = element => element.checkVisibility();
  const own = element => [...element.childNodes].filter(n => n.nodeType === 3).map(n => n.data);
  return [...document.querySelectorAll("body *")].filter(seen).flatMap(element => [
    ...own(element), element.getAttribute("title"), element.getAttribute("aria-label"),
    element.localName === "title" ? element.textContent : "",
  ]).map(text => (text ?? "").trim()).filter(Boolean);
}"""
CAPTIONS = """() => {
  const all = document.querySelectorAll("#panel th, #panel dt, #panel form label, #panel .about");
  const titled = one => one.closest("[title]") ?? one.querySelector("[title]");
  return [...all].filter(one => one.checkVisibility())
    .map(one => [one.textContent, titled(one)?.title ?? ""]);
}"""


def check_texts(page: Page) -> None:
    """No words that only a surveyor knows without an explanation."""
    texts = page.evaluate(TEXTS)
    assert len(texts) > 40
    wrong = [text for text in texts if JARGON.search(text) or NOTHING.search(text)]
    assert not wrong, "\n".join(sorted(set(wrong)))
    captions = page.evaluate(CAPTIONS)
    assert [text for text, title in captions if TERMS.search(text) and not title] == []


def look_everywhere(page: Page) -> None:
    """Check the photo's marks and numbers, every tab, and the help."""
    for tab in ("frames", "camera", "measure"):
        page.locator(f"#tab-button-{tab}").click()
        expect(page.locator(f"#tab-{tab}")).to_be_visible()
        check_texts(page)
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    check_texts(page)
    page.keyboard.press("Escape")


WINDOWS = [(1024, 640), (1920, 1080)]
"""A small and a large window."""


@pytest.mark.parametrize("width", [1366, 1920, 2300])
def test_an_adjusted_survey_is_told_in_plain_words(
    data_dir: Path, tmp_path: Path, open_page: PageOpener, width: int
) -> None:
    folder = tmp_path / "survey"
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=shutil.ignore_patterns("out", "*.tlog"))
    with served(folder / "project.yaml") as server:
        page = open_page(server, width, 900)
        wait_until_adjusted(page)
        expect(page.locator(".readout").first).to_contain_text("how far marks are off")
        look_everywhere(page)
        page.get_by_role("table", name="Points").locator('[name="select"]').first.click()
        page.get_by_role("table", name="Known lengths").locator('[name="change"]').first.click()
        check_texts(page)
        assert not open_page.errors


def test_statistics_in_a_warning_are_explained_where_the_pointer_rests(
    data_dir: Path, tmp_path: Path, open_page: PageOpener
) -> None:
    folder = tmp_path / "survey"
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=shutil.ignore_patterns("out", "*.tlog"))
    table = folder / "picks.csv"
    rows = table.read_text().splitlines()
    image, label, u, *rest = rows[3].split(",")
    rows[3] = ",".join([image, label, f"{float(u) + 5:.2f}", *rest])  # suspect, and no gross error
    table.write_text("\n".join(rows) + "\n")
    with served(folder / "project.yaml") as server:
        for window in WINDOWS:
            page = open_page(server, *window)
            wait_until_adjusted(page)
            page.locator("#why-title").click()
            terms = re.compile(r"\bsigmas?\b|expected error")
            told = page.locator("#reasons li").filter(has_text=terms)
            expect(told.first).to_be_visible()
            for one in told.all():
                expect(one).to_have_attribute("title", re.compile("standard deviation|explain"))


def test_what_is_not_known_is_left_empty(planted: PickingProject, open_page: PageOpener) -> None:
    for name, rows in (
        ("picks.csv", "image,label,u_px,v_px\nphoto.jpg,A,600,400\nphoto.jpg,B,900,400\n"),
        ("lines.csv", "name,from,to,length_m,sigma_m\nL,A,C,5,0.01\n"),
        ("measure.csv", "name,kind,points\nD,distance,A;B\nE,coordinate,A\nF,slope,A;B\n"),
    ):
        planted.path.with_name(name).write_text(rows)
    lost = "Not used: C is marked in no photo."
    with served(planted.path) as server:
        for window in WINDOWS:
            page = open_page(server, *window)
            expect(page.locator("#mode")).to_have_attribute("data-mode", "none")
            look_everywhere(page)
            for table in ("Points", "Known lengths", "Measurements"):
                cells = page.get_by_role("table", name=table).locator("td.value").all_inner_texts()
                assert {cell.strip() for cell in cells} - {lost} == {""}
