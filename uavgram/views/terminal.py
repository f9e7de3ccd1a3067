"""Plain text for a terminal: measurements, messages, checks, and matches of picks."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from uavgram.model.frames import Frames, GeoTags, Pairing, Photos
from uavgram.model.message import Message
from uavgram.model.message_catalogue import entry_of
from uavgram.model.naming import METRIC, Units, format_count, join_names
from uavgram.model.result.result import Result
from uavgram.stages.match import Matches, Pair
from uavgram.views.formatting import (
    LEVEL_RANK,
    NOT_UNIQUE,
    format_with_sigma,
    number,
    order_worst_first,
    utc,
)
from uavgram.views.result_tables import result_table
from uavgram.views.survey.verdict import scale_sentence, verdict_sentence
from uavgram.views.tables import align_columns, format_table
from uavgram.views.units import format_length, format_value, units_of


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
    shown = result_table(
        "measured", result, order_worst_first(rows)[: most or None].tolist(), "terminal"
    )
    return format_table(shown) + (f"\n{NOT_UNIQUE}" if rows.is_ambiguous.any() else "")


def findings_lines(result: Result, *, verbose: bool) -> list[str]:
    """Return the source of the scale, the messages, and last the verdict.

    No misfit shows a wrong scale: its source is a line of its own, as it is not the reason of the
    verdict. The verdict is last, so that it is visible without scrolling.
    """
    parts = (
        [scale] if (scale := scale_sentence(result)) else [],
        message_lines(result.messages, verbose=verbose),
        [verdict_sentence(result)],
    )
    return [line for part in parts if part for line in ("", *part)]


def hidden_rows_line(result: Result, most: int, folder: Path) -> list[str]:
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
                format_with_sigma(value, sigma, unit, units),
                format_value(known, sigma, unit, units),
                ("+" if off > 0 else "") + format_value(off, sigma, unit, units),
                number(off / sigma, 1, signed=True),
            )
        )
    return align_columns(cells, right=(2, 3, 4, 5))


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
    return [*align_columns(cells, right=(5,)).splitlines(), "", *notes, "every input can be read"]


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
        place = (f"{tags.latitude_deg[k]:.7f}", f"{tags.longitude_deg[k]:.7f}")
        lengths = (tags.height_m[k], tags.sigma_horizontal_m[k], tags.sigma_vertical_m[k])
        height, *spread = (format_length(float(one), units) for one in lengths)
        cells.append((name, tags.pose[k], *place, height, ", ".join(spread)))
    notes = message_lines(messages)
    return [
        *align_columns(cells, right=(2, 3, 4, 5)).splitlines(),
        "",
        f"heights are {datum}",
        *notes,
    ]


MAX_NAMED = 8
"""Largest number of names in a line; the others are counted only."""

MIN_POSE_POINTS = 3
"""Number of points in a photo from which its pose depends on them and not on the log alone."""


def match_lines(done: Matches) -> list[str]:
    """List the matches of each photo, failed searches with reasons, and picks to make by hand."""
    found, missed = done.record.found, done.record.in_vain
    looked = len(found) + len(missed)
    lines = [f"found:     {_describe_finds(len(found), looked, done)}"]
    lines += _count_by_photo(found, missed)
    lines += _reasons(missed)
    if done.not_sought:
        lines.append(
            f"not looked for: {join_names(done.not_sought, MAX_NAMED)}: their picks contradict "
            f"each "
            "other, or are not used in the adjustment, so no place is known: check them in "
            "`uavgram pick`; `uavgram run` gives the reason"
        )
    if done.turned_rad:
        lines.append(
            f"the camera pointed some {math.degrees(done.turned_rad):.0f} degrees away from its "
            "direction by the flight log and `mount` in the project, so points may have been "
            "looked for in wrong places: if few were found, remove them (`uavgram picks match "
            "--undo`), write `ties: auto` into the project, which orients the photos to each "
            "other, and run this again"
        )
    if done.unplaced:
        lines.append(
            f"not looked in: {join_names(done.unplaced, MAX_NAMED)}: its pose is unknown; "
            "pick three points or more there"
        )
    return lines + _list_useful_picks(done)


def _describe_finds(found: int, looked: int, done: Matches) -> str:
    if looked:
        return f"{found} of {looked} places, of {format_count(len(done.labels), 'label')}"
    if done.kept:
        return "no further search: earlier matches are kept"
    return "nothing was looked for: no other photo should show these labels"


def written_line(done: Matches) -> str:
    """Describe the written table: new matches, and earlier matches that were kept or removed."""
    line = f"written:   {done.path}, new matches: {len(done.record.found)}"
    if done.kept:
        line += f", earlier ones kept: {done.kept}"
    if done.replaced:
        line += f", taken out: {done.replaced} (their pick was moved, or they fit no longer)"
    return line


def _count_by_photo(found: Iterable[Pair], missed: Iterable[Pair]) -> list[str]:
    good = Counter(image for image, _ in found)
    every = good + Counter(image for image, _ in missed)
    width = max(map(len, every), default=0)
    return [f"  {image:<{width}}  {good[image]:>4} of {every[image]}" for image in sorted(every)]


def _reasons(missed: dict[Pair, str]) -> list[str]:
    by_reason: dict[str, list[str]] = defaultdict(list)
    for (image, label), why in sorted(missed.items()):
        by_reason[why].append(f"{label} in {image}")
    ordered = sorted(by_reason.items(), key=lambda one: -len(one[1]))
    return [
        "not found:",
        *(f"  {len(places):>4}  {why}: {join_names(places, MAX_NAMED)}" for why, places in ordered),
    ] * bool(by_reason)


def _list_useful_picks(done: Matches) -> list[str]:
    """List the labels and photos for which a pick by hand would add most information."""
    alone = [label for label, count in done.sightings.items() if count < 2]
    looked = {image for image, _ in (*done.record.found, *done.record.missed)}
    there = Counter(done.picks.image)
    few = sorted(image for image in looked if there[image] < MIN_POSE_POINTS)
    lines = []
    if alone:
        lines.append(f"  labels that one photo alone shows: {join_names(alone, MAX_NAMED)}")
    if few:
        lines.append(
            f"  photos with fewer than {MIN_POSE_POINTS} points: {join_names(few, MAX_NAMED)}"
        )
    return ["better picked by you (`uavgram pick`):", *lines] if lines else []
