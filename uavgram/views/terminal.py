"""Plain text for a terminal: the measurements, worst first, and the messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from uavgram.model.catalogue.lookup import entry_of
from uavgram.model.flight.frames import Frames, Pairing, Photos
from uavgram.model.flight.pose import GeoTags
from uavgram.model.message import Message
from uavgram.model.naming import METRIC, Units
from uavgram.model.result.result import Result
from uavgram.views.result_tables import result_table
from uavgram.views.survey.verdict import LEVEL_WORDS, scale_sentence
from uavgram.views.unit_words import in_units
from uavgram.views.units import units_of, value_text
from uavgram.views.formatting import (
    LEVEL_RANK,
    NOT_UNIQUE,
    number,
    utc,
    with_sigma,
    worst_first,
)


def measurement_table(result: Result, most: int = 0) -> str:
    """Format the measurements as aligned columns, the least certain first.

    Parameters
    ----------
    result
        Result of a run.
    most
        Number of rows to show; 0: all.

    Returns
    -------
    Lines without a trailing newline; a sentence if no measurement was requested.
    """
    rows = result.measurements
    if not rows.name:
        return "No measurements were requested (measure: in the project file)."
    shown = result_table("measured", result, worst_first(rows)[: most or None].tolist(), "terminal")
    cells = [shown.titles, *(tuple(cell.text for cell in row) for row in shown.rows)]
    right = tuple(
        k for k, title in enumerate(shown.titles) if shown.numbers[k] or title == "status"
    )
    return aligned(cells, right) + (f"\n{NOT_UNIQUE}" if rows.is_ambiguous.any() else "")


def light_line(result: Result) -> str:
    """Return two lines: the colour of the verdict, and the source of the scale.

    No misfit shows a wrong scale. The lines are separate, as the scale is not the reason of the
    verdict.
    """
    level = LEVEL_WORDS[result.verdict.level]
    return "\n".join(filter(None, [f"Verdict: {level}.", scale_sentence(result)]))


def unshown_rows(result: Result, most: int, folder: Path) -> list[str]:
    """Return the line on the rows that a table cut after `most` rows omits; empty if it has all.

    Parameters
    ----------
    result
        Result of the run.
    most
        Number of rows shown; 0: all.
    folder
        Folder of the run's files.
    """
    more = len(result.measurements.name) - most
    if not most or more <= 0:
        return []
    return [
        f"... and {more} more, which are known better: --rows 0 shows all, and all are in "
        f"{folder / 'measurements.csv'}"
    ]


def message_lines(messages: Sequence[Message], *, verbose: bool = True) -> list[str]:
    """Return one line per message: errors first, then warnings, then notes.

    Each ends with its code, which `uavgram explain` explains. Without `verbose`, details are left
    out: they are in results.json and in the report.
    """
    shown = [m for m in messages if verbose or not entry_of(m.code).is_detail]
    ordered = sorted(shown, key=lambda message: LEVEL_RANK[message.level])
    return [f"{message.level}: {message.text} [{message.code}]" for message in ordered]


def aligned(cells: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> str:
    """Format rows of text as columns two blanks apart, with a rule below the first row."""
    widths = [max(len(row[c]) for row in cells) for c in range(len(cells[0]))]
    lines = [
        "  ".join(
            text.rjust(width) if c in right else text.ljust(width)
            for c, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "-" * max(len(line) for line in lines), *lines[1:]])


def truth_table(result: Result, truth: Mapping[str, float]) -> str:
    """Compare measurements with their known true values, in the project's order."""
    rows, units = result.measurements, units_of(result)
    cells = [("measurement", "points", "value ± 1 sigma", "truth", "error", "error/sigma")]
    for i, name in enumerate(rows.name):
        value, sigma, unit = float(rows.value[i]), float(rows.sigma[i]), rows.unit[i]
        known = truth.get(name, float("nan"))
        off = value - known
        cells.append(
            (
                name,
                " ".join(rows.points[i]),
                with_sigma(value, sigma, unit, units),
                value_text(known, sigma, unit, units),
                ("+" if off > 0 else "") + value_text(off, sigma, unit, units),
                number(off / sigma, 1, signed=True),
            )
        )
    return aligned(cells, right=(2, 3, 4, 5))


def check_lines(
    photos: Photos, frames: Frames, pairing: Pairing | None, messages: Sequence[Message]
) -> list[str]:
    """Format the result of `uavgram check`: one line per photo, then the messages.

    Parameters
    ----------
    photos, frames
        (F,) sizes, and times with the reason where a photo has none.
    pairing
        Pairing with the log's camera events; None without any.
    messages
        Messages of the check.
    """
    cells = [("photo", "size", "exposure (UTC)", "matched", "camera event", "photo - event")]
    for i, name in enumerate(frames.frame_id):
        matched = "yes" if frames.matched[i] else frames.reason[i]
        size = f"{photos.width_px[i]:.0f} x {photos.height_px[i]:.0f}"
        instant = utc(float(frames.time_utc_s[i]))
        cells.append((name, size, instant, matched, *_event_cells(pairing, i)))
    notes = message_lines(messages)
    return [*aligned(cells, right=(5,)).splitlines(), "", *notes, "every input can be read"]


def _event_cells(pairing: Pairing | None, row: int) -> tuple[str, str]:
    """Return the number of a photo's camera event with its status, and the residual."""
    if pairing is None:
        return "–", "–"
    event = int(pairing.event_index[row])
    which = "none" if event < 0 else f"{event + 1} ({pairing.status[row]})"
    return which, f"{number(float(pairing.residual_s[row]), 3, signed=True)} s"


def geotag_lines(tags: GeoTags, messages: Sequence[Message], units: Units = METRIC) -> list[str]:
    """Format the result of `uavgram geotag`: one line per photo, the datum, then the messages.

    Parameters
    ----------
    tags
        Geotags of every photo that has a pose.
    messages
        Messages of the command.
    units
        Units in which heights are shown.
    """
    datum = "above mean sea level" if tags.datum == "msl" else "above the WGS 84 ellipsoid"
    cells = [("photo", "pose", "latitude", "longitude", "height", "sigma (horizontal, height)")]
    for k, name in enumerate(tags.frame_id):
        sigmas = f"{tags.sigma_horizontal_m[k]:.2f} m, {tags.sigma_vertical_m[k]:.2f} m"
        place = (f"{tags.latitude_deg[k]:.7f}", f"{tags.longitude_deg[k]:.7f}")
        height, spread = (in_units(t, units) for t in (f"{tags.height_m[k]:.2f} m", sigmas))
        cells.append((name, tags.pose[k], *place, height, spread))
    notes = message_lines(messages)
    return [*aligned(cells, right=(2, 3, 4, 5)).splitlines(), "", f"heights are {datum}", *notes]
