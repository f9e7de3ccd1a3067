"""Remedies on the page: its own places, or the file to be edited; never an option alone."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import uavgram
from uavgram.picking.protocol.encode_quantities import word_for_page
from uavgram.picking.protocol.ways_on_page import WAYS, name_on_page

IN_SET_UP = ": in the set-up of the folder; under Camera, 'Change camera, mount, tape or case'.)"


@pytest.mark.parametrize(
    ("message", "on_page"),
    [
        (
            "the disk is full; free some space, or choose another folder with --output",
            "the disk is full; free some space, or copy the photos to another folder, and open "
            "that",
        ),
        ("Set --fix-aspect, or take photos rolled.", "Take photos rolled."),
        (
            "To confirm it, let its height be found from the photos (`free` in the column height_m "
            "of picks.csv), or enter it.",
            "To confirm it, let its height be found from the photos (key Q), or enter it.",
        ),
        (
            "State the camera's direction in `mount`. Tape L1 again.",
            f"State the camera's direction in the mount. Tape L1 again. (the mount{IN_SET_UP}",
        ),
        (
            "set time.offset_s (camera clock minus UTC), or `ties: auto`, which finds it",
            "set time.offset_s (camera clock minus UTC), or `ties: auto`, which finds it. "
            "(time.offset_s and ties: in the file project.yaml, with a text editor; then open the "
            "project again.)",
        ),
        (
            "P2.jpg: no such file, or write `leave_out: [P2.jpg]` into project.yaml to go on "
            "without it",
            "P2.jpg: no such file, or leave it out by the button in the list of photos",
        ),
        (
            "If you know the tilt, set `mount.pitch_deg`.",
            "If you know the tilt, set the angle below the horizon. (the angle below the horizon"
            f"{IN_SET_UP}",
        ),
        (
            "All photos are turned by +180 degrees (mount.roll_deg).",
            "All photos are turned by +180 degrees (the tilt about the line of sight). (the tilt "
            f"about the line of sight{IN_SET_UP}",
        ),
        (
            "If you are not sure, write `auto` into `mount`.",
            f"If you are not sure, choose 'As recorded' for the mount. (the mount{IN_SET_UP}",
        ),
        (
            "Go on, or write `camera: unknown` in the project.",
            f"Go on, or write `camera: unknown` in the project. (the camera{IN_SET_UP}",
        ),
        ("`picks.csv` and `control.csv` hold them.", "`picks.csv` and `control.csv` hold them."),
        (
            "Run again with --monte-carlo for its exact interval.",
            "Run again with --monte-carlo for its exact interval. (--monte-carlo: in a terminal; "
            "the page has nothing for it.)",
        ),
        (
            "Write 'horizontal' into the column `along` of lines.csv if it was level.",
            "Write 'horizontal' into the column `along` of lines.csv if it was level. (along: in "
            "the file lines.csv, with a text editor; then open the project again.)",
        ),
        (
            "Name the flight's log (`log:`), if there is one.",
            f"Name the flight's log (the log), if there is one. (the log{IN_SET_UP}",
        ),
    ],
)
def test_a_remedy_is_one_of_the_page_or_names_the_file(message: str, on_page: str) -> None:
    assert name_on_page(message) == on_page


@pytest.mark.parametrize(
    "sentence", ["The mount -- of the camera, as it is.", "lines.csv:3: sigma_m: must be positive"]
)
def test_other_words_stay(sentence: str) -> None:
    assert name_on_page(sentence) == sentence


def test_sentences_are_worded_and_data_is_not() -> None:
    message = {"why": [{"text": "Run `uavgram check` ", "labels": ["--output"]}], "t": "live"}

    worded = word_for_page(message)["why"][0]

    assert worded == {"text": "Run The list of photos ", "labels": ["--output"]}


def literals(*rooms: str) -> str:
    """Return the texts of the package's modules but the one under test, one a line."""
    found = []
    package = Path(uavgram.__file__).parent
    for path in (one for room in rooms or ("",) for one in (package / room).rglob("*.py")):
        if path.name != "ways_on_page.py":
            for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(one, ast.JoinedStr):
                    parts = (str(getattr(part, "value", "")) for part in one.values)
                    found.append("".join(p if not p.startswith("<ast") else "X" for p in parts))
                elif isinstance(one, ast.Constant) and isinstance(one.value, str):
                    found.append(one.value)
    return "\n".join(found)


def test_each_way_is_for_a_message_that_exists() -> None:
    """A message that is worded anew would else keep its option on the page."""
    # The option of another folder, and the setting of photos left out, are variables there.
    text = literals().replace("with X", "with --output").replace("without X", "without it")
    text = text.replace("write `X` into X", "write `leave_out: [P1.jpg]` into project.yaml")

    assert [way.pattern for way, _ in WAYS if not re.search(way, text)] == []


CELLS = re.compile(
    r"\b(?:delete (?:the|its|their|these) rows?|(?:in|and|with a|the) (?:height|length|sigma)_m\b)"
)
"""A row or a cell of a table, which the page does not show."""


def test_no_advice_names_a_row_or_a_cell() -> None:
    advice = [name_on_page(one) for one in literals("stages", "estimation", "pipeline").split("\n")]

    assert [one for one in advice if CELLS.search(one)] == []
