"""Text pages in the recording of a plan."""

from __future__ import annotations

import rerun as rr

from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.markdown import plain, table
from uavgram.views.planned.numbers import metres
from uavgram.views.planned.tables import line_rows, plate_rows, value_rows
from uavgram.views.planned.words import (
    assumed,
    chosen,
    flight_facts,
    headline,
    if_a_line_is_lost,
    outcome,
    take_off_words,
)
from uavgram.views.recording.stream import Recorder
from uavgram.views.unit_words import in_units, like_lengths

SUMMARY, LAY, PHOTO = "documents/summary", "documents/lines", "documents/photo"


def log_plan_documents(recorder: Recorder, planned: FlightPlanned, units: Units) -> None:
    """Log all pages.

    Parameters
    ----------
    recorder
        The open recording.
    planned
        The plan.
    units
        Units of the lengths shown.
    """
    named = (*planned.lines.name, *planned.measurements.name, *planned.points.label, planned.name)
    kept = like_lengths(named)
    for path, text in ((SUMMARY, summary_page(planned, units)), (LAY, lines_page(planned))):
        told = in_units(text, units, kept)
        recorder.static(path, rr.TextDocument(told, media_type=rr.MediaType.MARKDOWN))
    sheets = [in_units(photo_page(planned, k), units) for k in range(len(planned.frames.name))]
    recorder.sheets(PHOTO, sheets)


def summary_page(planned: FlightPlanned, units: Units) -> str:
    """Write the summary page."""
    parts = [f"# {plain(headline(planned))}", *map(plain, outcome(planned))]
    parts += [f"**{plain(m.text)}** `{m.code}`" for m in planned.messages if m.level != "info"]
    if planned.measurements.name:
        rows = [
            (
                plain(row.name),
                row.about,
                f"**± {row.sigma}**",
                f"± {row.wanted}" if row.wanted else "–",
                {None: "–", True: "yes", False: "**NO**"}[row.is_good],
            )
            for row in value_rows(planned, units)
        ]
        head = ("value", "about", "will be known to", "wished", "good enough?")
        parts += ["## What will be measured", table(head, rows)]
    facts = [(plain(key), f"**{plain(value)}**") for key, value in flight_facts(planned)]
    parts += ["## The flight", table(("", ""), facts), plain(take_off_words(planned))]
    if planned.gains:
        more = [(plain(gain.what), f"± {100 * gain.mean_sigma:.1f} cm") for gain in planned.gains]
        parts += ["## Other choices", table(("with", "on average"), more)]
    parts += [plain(text) for text in (chosen(planned), assumed(planned)) if text]
    parts += [f"{plain(m.text)} `{m.code}`" for m in planned.messages if m.level == "info"]
    return "\n\n".join(parts)


def lines_page(planned: FlightPlanned) -> str:
    """Write the page of lines and plates to lay out, and of alternatives."""
    rows = [
        (
            plain(row.name),
            f"**{row.length}**",
            plain(f"{row.start}: {row.start_place}"),
            plain(f"{row.end}: {row.end_place}"),
            str(row.photos),
            row.mistake or "never: tape it twice",
        )
        for row in line_rows(planned)
    ]
    if planned.plates.name:
        plates = [(row.name, plain(row.place), str(row.photos)) for row in plate_rows(planned)]
        laid = table(("plate", "middle", "photos"), plates)
        return "\n\n".join([laid, *map(plain, if_a_line_is_lost(planned))])
    if not rows:
        return "No line is to be laid."
    head = ("line", "length", "from", "to", "photos", "mistake noticed from")
    return "\n\n".join([table(head, rows), *map(plain, if_a_line_is_lost(planned))])


def photo_page(planned: FlightPlanned, row: int) -> str:
    """Write the sheet of one photo: position and attitude of the drone."""
    frames = planned.frames
    facts = [
        ("height above the ground", metres(float(frames.height_above_ground_m[row]))),
        ("nose", f"{frames.heading_deg[row] % 360:.0f}° from north"),
        ("camera", f"{-frames.gimbal_pitch_deg[row]:.0f}° below level"),
    ]
    return f"# {plain(frames.name[row])}\n\n" + table(("", ""), facts)
