"""Make the pictures of README and manual from the demo: `python .readme/pictures.py DEMO [FOLDER]`.

DEMO is what `uavgram demo` wrote, and is not changed; a plan that is in its results is not drawn
again. A test makes all pictures anew and compares. Needs Chromium, and tests/support for the
picking page.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

import uavgram
from uavgram.cli import main

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

NAMES = ("plan", "field-sheet", "log", "pick", "report", "budget")
WIDTH_PX, QUALITY = 1200, 82
CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--force-color-profile=srgb")


def make(demo: Path, folder: Path) -> None:
    """Write every picture into a folder.

    Parameters
    ----------
    demo
        Folder of the demo with its results.
    folder
        Exists already.
    """
    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        work = Path(name)
        survey = work / "crossing"
        shutil.copytree(demo, survey)
        project = survey / "project.yaml"
        if not (survey / "out" / "plan.png").is_file():
            _run("run", project, "--plan", "a4", "--quiet")
        _plan(survey / "out" / "plan.png", folder / "plan.jpg")
        _run("log", survey / "flight.tlog", "--plot", work / "log.png")
        log = _opened(work / "log.png")
        _saved(log.crop((0, 0, log.width, round(0.535 * log.height))), folder / "log.jpg")
        _budget(survey / "out" / "results.json", work / "budget.png")
        _saved(_opened(work / "budget.png"), folder / "budget.jpg")
        scenario = (ROOT / "configs" / "plan.yaml").read_text(encoding="utf-8")
        placed = scenario.replace("# site:", "site:").replace(
            "#        scene_north", "  scene_north"
        )
        (work / "plan.yaml").write_text(placed, encoding="utf-8")
        _run("plan", work / "plan.yaml", "--output", work / "plan", "--quiet")
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        sheet = work / "plan" / "field_sheet.html"
        _page(browser, sheet.as_uri(), folder / "field-sheet.jpg")
        _page(browser, (survey / "out" / "report.html").as_uri(), folder / "report.jpg")
        _picking(project, browser, folder / "pick.jpg")
        browser.close()


def _run(*arguments: object) -> None:
    status = main([str(one) for one in arguments])
    if status:
        raise SystemExit(f"uavgram {arguments}: status {status}")


def _opened(path: Path) -> Image.Image:
    with Image.open(path) as picture:
        return picture.convert("RGB")


def _saved(picture: Image.Image, path: Path) -> None:
    """Write a picture at the width of the manual."""
    height = round(picture.height * WIDTH_PX / picture.width)
    picture.convert("RGB").resize((WIDTH_PX, height), Image.Resampling.LANCZOS).save(
        path, quality=QUALITY, optimize=True
    )


def _plan(source: Path, path: Path) -> None:
    """Cut the white margin of the sheet away."""
    picture = _opened(source)
    inked = picture.convert("L").point(lambda grey: 255 if grey < 250 else 0).getbbox()
    _saved(picture.crop(inked), path)


def _budget(results: Path, path: Path) -> None:
    figure, axes = plt.subplots(figsize=(9, 4.2), dpi=150)
    uavgram.plots.budget(uavgram.load_results(results), axes)
    figure.savefig(path, bbox_inches="tight")
    plt.close(figure)


def _page(browser: Browser, address: str, path: Path, height_px: int = 900) -> None:
    """Picture the top of a page."""
    page = browser.new_page(viewport={"width": WIDTH_PX, "height": height_px})
    page.goto(address)
    page.wait_for_load_state("load")
    _shot(page, path)


def _shot(page: Page, path: Path) -> None:
    png = path.with_suffix(".png")
    page.screenshot(path=png)
    _saved(_opened(png), path)
    png.unlink()
    page.close()


def _picking(project: Path, browser: Browser, path: Path) -> None:
    """Picture the picking page once everything is adjusted."""
    from opened_pages import PageOpener  # noqa: PLC0415
    from picking_pages import wait_until_adjusted  # noqa: PLC0415
    from picking_server import served  # noqa: PLC0415

    with served(project) as server:
        opener = PageOpener(browser)
        page = opener(server, WIDTH_PX, 760)
        wait_until_adjusted(page)
        page.wait_for_timeout(500)
        _shot(page, path)
        opener.close()


if __name__ == "__main__":
    make(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else HERE)
