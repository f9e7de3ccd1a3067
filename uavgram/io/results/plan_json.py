"""Reader and writer of plan.json, the complete plan."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.json_text import parse_json
from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import Record, encode, from_record
from uavgram.io.results.results_json import format_record_per_line, load_message
from uavgram.model.planned import (
    AccuracyGrid,
    FlightPlanned,
    PlannedLines,
    PlannedPlates,
    PlannedPoints,
)

SCHEMA = 1
_MARK, _BEGINNING = '"plan_schema"', 200


def write_plan(plan: FlightPlanned, path: str | Path) -> None:
    """Write a plan.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    messages = [message.record() for message in plan.messages]
    record = {"plan_schema": SCHEMA} | encode(plan) | {"messages": messages}
    replace_text(Path(path), format_record_per_line(record))


def is_plan(path: Path) -> bool:
    """Return whether a file begins like those of `write_plan`."""
    try:
        with path.open(encoding="utf-8") as file:
            return _MARK in file.read(_BEGINNING)
    except (OSError, UnicodeDecodeError):
        return False


def read_plan(path: str | Path) -> FlightPlanned:
    """Read a plan.

    Raises
    ------
    InputError
        The file cannot be read, or is not a plan of this program.
    """
    path = Path(path)
    text = read_text(path, "so it is no plan")
    try:
        content = parse_json(path, text)
    except json.JSONDecodeError as fault:
        raise InputError(
            path, f"is not complete JSON ({fault.msg}): plan again", fault.lineno
        ) from fault
    if not isinstance(content, dict) or "plan_schema" not in content:
        raise InputError(path, "is no plan: name the plan.json that `uavgram plan` wrote")
    if content["plan_schema"] != SCHEMA:
        raise InputError(
            path,
            f"is of plan_schema {content['plan_schema']!r}, this program reads {SCHEMA}: "
            "plan again",
        )
    try:
        messages = tuple(load_message(record) for record in content["messages"])
        written = {name: content[name] for name in PARTS if name in content}
        parts = {name: _part(PARTS[name], record) for name, record in written.items()}
        return from_record(FlightPlanned, content, messages=messages, **parts)
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError(path, f"was edited ({fault!r}): plan again") from fault


PARTS: dict[str, type] = {
    "lines": PlannedLines,
    "plates": PlannedPlates,
    "points": PlannedPoints,
    "grid": AccuracyGrid,
}
"""Parts of a plan that may be empty."""


def _part(owner: type, record: Record) -> object:
    """Read a part of a plan; an empty list of points still has three coordinates."""
    none = {name: np.zeros((0, 3)) for name in record if name.endswith("world_m")}
    none |= {name: np.zeros((0, 4, 3)) for name in record if name == "corner_world_m"}
    return from_record(owner, record, **{name: none[name] for name in none if not record[name]})
