"""The pictures of README and manual are what the demo shows today."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flight_projects import Tutorial
from manual_pages import manual_pages
from PIL import Image

from uavgram.model.arrays import Floats

MOST_APART = 12.0
"""Mean difference of grey values after reduction: fonts and dates differ between machines."""
ROOT = Path(__file__).parents[2]
FOLDER = ROOT / ".readme"
DRAWINGS = {"image", "frames", "pitch", "slope", "likelihood", "rooms"}


def reduced(path: Path) -> Floats:
    with Image.open(path) as picture:
        grey = picture.convert("L").resize((48, 36), Image.Resampling.BOX)
    return np.asarray(grey, dtype=np.float64)


def test_every_picture_of_a_page_is_made() -> None:
    named = {
        Path(link)
        for page in manual_pages()
        for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.text)
        + re.findall(r"^\*Drawing `(\S+)`:", page.text, flags=re.MULTILINE)
    }

    assert {path.stem for path in named if path.parent.name == "made"} == DRAWINGS
    photos = {path.name for path in named if path.parent.name == ".readme"}
    assert photos == {path.name for path in FOLDER.glob("*.jpg")}
    assert len(photos) + len(DRAWINGS) == len({path.name for path in named})


def test_the_pictures_are_of_the_program_as_it_is(tutorial: Tutorial, tmp_path: Path) -> None:
    if not Path("/usr/bin/chromium").is_file():
        pytest.skip("no browser at /usr/bin/chromium: apt install chromium")
    # In a process of its own: the browser of other tests has the event loop of this one.
    made = [sys.executable, str(FOLDER / "pictures.py"), str(tutorial.folder / "crossing")]
    subprocess.run([*made, str(tmp_path)], check=True, capture_output=True, timeout=300)

    for kept in sorted(FOLDER.glob("*.jpg")):
        name, new = kept.stem, tmp_path / kept.name
        apart = np.abs(reduced(new) - reduced(kept)).mean()
        assert apart < MOST_APART, f"{name}: python .readme/pictures.py DEMO makes it anew"
