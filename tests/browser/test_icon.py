"""The icon for Windows is a picture of the page's."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Browser

ICON = runpy.run_path(str(Path(__file__).parents[2] / ".ci" / "icon.py"))


def test_the_icon_for_windows_shows_the_icon_of_the_page(chromium: Browser) -> None:
    with Image.open(ICON["PAGE"] / "icon.ico") as icon:
        assert icon.info["sizes"] == {(side, side) for side in ICON["SIZES_PX"]}
        pixels = np.asarray(icon.convert("RGBA"), float)
    drawn = np.asarray(ICON["draw"](chromium), float)
    assert drawn.shape == pixels.shape
    assert np.abs(drawn - pixels).mean() < 1
