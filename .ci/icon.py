"""Make the icon for Windows from the page's: `.venv/bin/python .ci/icon.py [CHROMIUM]`.

A test compares them.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

PAGE = Path(__file__).parents[1] / "uavgram" / "picking" / "page"
LARGEST_PX = 256
SIZES_PX = (16, 24, 32, 48, 64, 128, LARGEST_PX)


def draw(browser: Browser) -> Image.Image:
    """Draw icon.svg in the largest size of an icon, on a transparent ground."""
    page = browser.new_page(viewport={"width": LARGEST_PX, "height": LARGEST_PX})
    drawing = (PAGE / "icon.svg").read_text(encoding="utf-8")
    page.set_content(f"<style>body{{margin:0}} svg{{display:block}}</style>{drawing}")
    content = page.screenshot(omit_background=True)
    page.close()
    return Image.open(io.BytesIO(content)).convert("RGBA")


if __name__ == "__main__":
    with sync_playwright() as driver:
        chromium = sys.argv[1] if len(sys.argv) > 1 else "/usr/bin/chromium"
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        sizes = [(side, side) for side in SIZES_PX]
        draw(browser).save(PAGE / "icon.ico", sizes=sizes)
        browser.close()
