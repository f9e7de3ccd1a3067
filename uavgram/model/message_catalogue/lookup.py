"""The catalogue of messages: one entry for each code, by subject."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from uavgram.model.message_catalogue.cameras import CALIBRATION, CAMERA
from uavgram.model.message_catalogue.entry import Entry, Subject
from uavgram.model.message_catalogue.left_out import EXCLUDED, UNUSED
from uavgram.model.message_catalogue.misfits import FOUND_CAUSES, MISFITS
from uavgram.model.message_catalogue.photos import FLIGHT_LOG, POSES, TIMES
from uavgram.model.message_catalogue.projects import (
    IMPORTS,
    NEW_PROJECT,
    PLANNING,
    PRODUCTS,
    TARGETS,
    TIES,
)
from uavgram.model.message_catalogue.trust import GROUND, TRUST

SUBJECTS = (
    Subject(
        "Causes that were found",
        FOUND_CAUSES,
        "Each cause explains why other observations do not fit. With `outliers: remove` the "
        "program corrects many of them and reports the values before and after. With "
        "`outliers: report` it changes nothing and marks the measurements that are affected.",
    ),
    Subject("Observations that do not fit", MISFITS),
    Subject("Observations left out or removed", EXCLUDED),
    Subject("Data that is not used", UNUSED),
    Subject("How far the result can be trusted", TRUST),
    Subject("Ground and heights", GROUND),
    Subject("The camera", CAMERA),
    Subject("The flight log", FLIGHT_LOG),
    Subject("Photos and their times", TIMES),
    Subject("Where photos were taken", POSES),
    Subject("A new project", NEW_PROJECT),
    Subject("Tie points", TIES),
    Subject("Products", PRODUCTS),
    Subject("Importing picks", IMPORTS),
    Subject("Finding targets", TARGETS),
    Subject("Calibrating a camera", CALIBRATION),
    Subject(
        "Planning a flight",
        PLANNING,
        "These messages are of `uavgram plan`: on screen and in `plan.json`.",
    ),
)

CATALOGUE: Mapping[str, Entry] = MappingProxyType(
    {entry.code: entry for subject in SUBJECTS for entry in subject.entries}
)


def entry_of(code: str) -> Entry:
    """Return the entry of a code; an empty one for an unknown code (from another version)."""
    return CATALOGUE.get(code) or Entry(code, ("info", "warning", "error"), finding="")
