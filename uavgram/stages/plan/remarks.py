"""What to know of a plan before flying: what it does not reach, and what nothing checks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.message import Message
from uavgram.model.naming import figures
from uavgram.model.planned.parts import PlannedLines, PlannedMeasurements, PlannedPlates
from uavgram.model.scenario.scenario import Site

LARGE_M = 0.3
"""A mistake of a tape reading that people do make: a slipped decimetre mark or three."""

LEAST_GAIN = 0.1
"""Share of the sigmas that reference lines must take away to be worth the work."""


FEW_LINES = 3
"""Fewer leave the tilt of a single photo to its log: over its sigmas lengths bend by so much that
errors of simulated surveys were 1.0 to 1.3 times what is predicted to first order with one line,
and 0.95 to 1.2 times with two; second order overshoots there. From three lines on neither shows."""


def nowhere() -> Message:
    """What to know of a plan in metres of which nobody said where on earth they count from."""
    site = Site()
    return Message(
        "warning",
        "plan-nowhere",
        "Nobody said where on earth this is, so no mission file was written: the maps and the "
        "north of the drawing are of the place of the program's demo "
        f"({site.latitude_deg:.4f}, {site.longitude_deg:.4f}). Write site: {{latitude_deg: ..., "
        "longitude_deg: ..., scene_east_m: 0, scene_north_m: 0, road_azimuth_deg: ...}, where "
        "your [0, 0] lies and where the first axis of your metres points, clockwise from north; "
        "or give the area as a GeoJSON or KML file.",
    )


def remarks(
    laid: tuple[PlannedLines, PlannedPlates],
    measured: PlannedMeasurements,
    gained: float,
    photos: int,
) -> Iterator[Message]:
    """What to know of a plan before flying.

    Parameters
    ----------
    laid, measured
        As they will be; there are either lines or plates.
    gained
        Share of the mean sigma that they take away; 1 where nothing holds without them.
    photos
        How many are taken.
    """
    lines, plates = laid
    if gained < LEAST_GAIN and (lines.name or plates.name):
        what, instead = (
            (f"Plates of {plates.side_m:g} m", "larger ones, tape long lines (lay: lines)")
            if plates.name
            else (
                f"The reference lines, the longest {lines.length_m.max():.1f} m,",
                "a longer tape (longest_tape_m), a better log",
            )
        )
        yield Message(
            "warning",
            "plan-lines-useless",
            f"{what} make what is measured only {100 * gained:.0f} % more certain than none. Use "
            f"{instead}, or save the work.",
            lengths=lines.name,
        )
    if photos == 1 and 0 < len(lines.name) < FEW_LINES:
        yield Message(
            "warning",
            "plan-few-lines",
            f"With {len(lines.name)} reference line{'s' * (len(lines.name) > 1)} in a single photo "
            "errors may be up to a third larger than the ± of this plan: how the camera was tilted "
            f"is then known from the log alone. Lay {FEW_LINES} lines or more, or take more "
            "photos.",
            lengths=lines.name,
        )
    short = np.flatnonzero(measured.sigma > 1.0001 * measured.wanted_sigma)
    for i in short:
        yield Message(
            "warning",
            "plan-not-reached",
            f"{measured.name[i]!r} will be known to ± {figures(measured.sigma[i], 3)} "
            f"{measured.unit[i]}, "
            f"not to the ± {figures(measured.wanted_sigma[i], 3)} {measured.unit[i]} that are "
            "wanted, with "
            "any flight and layout that was tried. Allow more lines (most_lines), longer ones "
            "(longest_tape_m), lower heights or more photos (heights_m, frames, patterns), pick "
            "more sharply, or accept it.",
            measurements=(measured.name[i],),
        )
    passes = np.isnan(lines.mdb_m) | (lines.mdb_m > LARGE_M)
    if passes.any():
        names = tuple(lines.name[i] for i in np.flatnonzero(passes))
        yield Message(
            "warning",
            "plan-unchecked",
            f"A mistake of {figures(LARGE_M, 1)} m in the tape reading of {', '.join(names)} "
            "would go "
            "unnoticed: the other lines check it too little. Read the tape twice there, tape one "
            "more line, or take more photos.",
            lengths=names,
        )
    for own, kind, more in (
        (lines, "the line", "Tape one more line"),
        (plates, "the plate", "Lay one more plate"),
    ):
        names = tuple(own.name[i] for i in np.flatnonzero(np.isnan(own.mean_sigma_without)))
        if names:
            yield Message(
                "warning",
                "plan-needs-line",
                f"Without {kind} {', '.join(names)} the photos hang on too little, and nothing "
                f"could be measured to any use. {more}, or write `robust: true` in the plan.",
                lengths=names if own is lines else (),
            )
