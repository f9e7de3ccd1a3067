"""Sentences for the page, whose user sees no terminal: commands and settings by their place there.

Messages name commands, options and settings as the command line and the project file have them, in
backquotes. A remedy that the page has too is given its place there; for any other setting the
sentence ends with the file to be edited, and for any other command with where it is given.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from typing import get_type_hints

from uavgram.config.project import PROJECT_FILE
from uavgram.model.message import FREE_HEIGHT
from uavgram.model.naming import join_names
from uavgram.model.options import Project

WAYS = tuple(
    (re.compile(pattern), way)
    for pattern, way in (
        (
            r"choose (an?|another) folder( with a shorter path)? with --output"
            r"(?: \(or `output` in the project\))?",
            r"copy the photos to \1 folder\2, and open that",
        ),
        (r"(?:with|in|by|of|on) `uavgram pick(?: [^`s][^`]*)?`", "on this page"),
        (r"`uavgram pick(?: [^`s][^`]*)?`", "this page"),
        (r"`uavgram check`", "The list of photos"),
        (r"`uavgram picks ties`", "`ties: auto` in the project"),
        (
            r"Run `uavgram picks match` again, or delete (?:the match|these matches)",
            "Delete the pick there, and accept a new proposal",
        ),
        (r"(?:run )?`uavgram calibrate[^`]*`", "use 'Calibrate on a folder', under Camera"),
        (r"calibrate it from these photos", "use 'Calibrate on a folder', under Camera"),
        (r" \(--outliers remove\)", " (move its file away)"),
        (
            r"write `leave_out: [^`]*` into \S+ to go on without (it|them)",
            r"leave \1 out by the button in the list of photos",
        ),
        (r"--board\b", "the board"),
        (r"Set --fix-aspect, or take", "Take"),
        (r" \(--coefficients auto chooses\)", ""),
        (r"state --control-sigma-m\b", "state how well the points are known (±)"),
        (re.escape(FREE_HEIGHT), "(key Q)"),
        (r"write `auto` into `mount`", "choose 'As recorded' for `mount`"),
    )
)
"""Commands, options and cells of tables in the words of messages, and the same on the page."""

_COMMAND = re.compile(r"`uavgram [^`]+`|(?<![\w-])--[a-z][\w-]+")

_KEYS = get_type_hints(Project)
_SECTIONS = [key for key, kind in _KEYS.items() if is_dataclass(kind)]
_SETTING = re.compile(
    rf"`(?P<quoted>(?:{'|'.join(_SECTIONS)})\.\w+|(?:{'|'.join(_KEYS)}))(?::[^`]*)?`"
    rf"|\b(?P<plain>(?:{'|'.join(_SECTIONS)})\.[a-z]\w+|{'|'.join(k for k in _KEYS if '_' in k)})\b"
)
_COLUMN = re.compile(r"\bcolumn `(\w+)` of (\w+\.csv)")
_ANY = re.compile(rf"`|--[a-z]|[a-z]_[a-z]|\b(?:{'|'.join(_SECTIONS)})\.[a-z]")
"""A command, an option or a setting, quickly: most sentences name none."""

_IN_SET_UP = {
    "camera": "the camera",
    "log": "the log",
    "mount": "the mount",
    "mount.gimbal": "the gimbal",
    "mount.pitch_deg": "the angle below the horizon",
    "mount.yaw_deg": "the turn from the nose",
    "mount.roll_deg": "the tilt about the line of sight",
    "tape.reading_sigma_m": "the ± of a reading of the tape",
    "units": "the units",
    "case": "the case",
}
"""Settings that the set-up of a folder asks for, by their names there."""


def name_on_page(sentence: str) -> str:
    """Return a sentence with the places on the page in place of commands, options and settings.

    Parameters
    ----------
    sentence
        Finding, consequence and action, as for the command line.

    Returns
    -------
    str
        The same, followed by the file to be edited or the command to be given where the page has
        no place for it.
    """
    if not _ANY.search(sentence):
        return sentence
    for pattern, way in WAYS:
        sentence = pattern.sub(way, sentence)
    notes = " ".join(_notes(sentence))
    sentence = _SETTING.sub(_name_setting, sentence)
    if not notes:
        return sentence
    return f"{sentence}{'' if sentence.endswith(('.', '?', '!')) else '.'} {notes}"


def _name_setting(found: re.Match[str]) -> str:
    """Return the name that the set-up has for a setting; one with a value stays as it is."""
    has_value = ": " in found[0]
    return found[0] if has_value else _IN_SET_UP.get(found["quoted"] or found["plain"], found[0])


def find_set_up(sentence: str) -> list[str]:
    """Return the settings in a sentence that the set-up of the folder asks for."""
    return [key for key in _find_settings(sentence) if key in _IN_SET_UP]


def _find_settings(sentence: str) -> list[str]:
    return list(dict.fromkeys(m["quoted"] or m["plain"] for m in _SETTING.finditer(sentence)))


def _notes(sentence: str) -> Iterator[str]:
    """Yield where the settings and commands that a sentence names are changed or given."""
    named = _find_settings(sentence)
    if here := find_set_up(sentence):
        yield (
            f"({join_names(map(_IN_SET_UP.__getitem__, here))}: in the set-up of the folder; under "
            "Camera, 'Change camera, mount, tape or case'.)"
        )
    if "leave_out" in named:
        yield "(leave_out: by the buttons in the list of photos.)"
    if edited := [key for key in named if key not in {*_IN_SET_UP, "leave_out"}]:
        yield (
            f"({join_names(edited)}: in the file {PROJECT_FILE}, with a text editor; then open the "
            "project again.)"
        )
    for column, table in dict.fromkeys(_COLUMN.findall(sentence)):
        yield (f"({column}: in the file {table}, with a text editor; then open the project again.)")
    if commands := [*dict.fromkeys(match[0].strip("`") for match in _COMMAND.finditer(sentence))]:
        yield f"({join_names(commands)}: in a terminal; the page has nothing for it.)"
