"""Observations of a project beside its tables: plates, lines of position, and corrections."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from uavgram.model import observations
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.options import TargetOptions
from uavgram.model.survey import Cause, World
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import transform_known
from uavgram.stages.assemble import Assembled
from uavgram.stages.plates import SQUARE, add_plate_sides, make_scale_prior


def apply_corrections(inputs: Inputs, assembled: Assembled, causes: Iterable[Cause]) -> Inputs:
    """Apply corrections to the tables of the inputs, as the adjustment did.

    Parameters
    ----------
    inputs
        The project.
    assembled
        Assembled survey, with the rows of its picks and lengths.
    causes
        Causes of misfits that were corrected, in their order.
    """
    for cause in causes:
        mend = cause.mend
        if mend is None:
            continue
        label = assembled.survey.label
        pick = {int(k): i for i, k in enumerate(assembled.pick_index) if k >= 0}
        line = {int(k): i for i, k in enumerate(assembled.line_index) if k >= 0}
        inputs = replace(
            inputs,
            picks=_picks(
                inputs.picks,
                {pick[k]: label[at] for k, at in mend.label_of_pick.items()},
                {pick[k]: place for k, place in mend.pixel_of_pick.items()},
            ),
            lines=_lines(
                inputs.lines,
                {line[k]: value for k, value in mend.length_m.items()},
                {line[k]: (label[a], label[b]) for k, (a, b) in mend.ends.items()},
                {line[k] for k in mend.level},
            ),
        )
    return inputs


def _picks(
    picks: observations.Picks, label: dict[int, str], pixel_px: dict[int, tuple[float, float]]
) -> observations.Picks:
    labels, pixels = list(picks.label), np.array(picks.pixel_px)
    for row, name in label.items():
        labels[row] = name
    for row, place in pixel_px.items():
        pixels[row] = place
    return replace(picks, label=tuple(labels), pixel_px=pixels)


def _lines(
    lines: observations.KnownLines,
    length_m: dict[int, float],
    ends: dict[int, tuple[str, str]],
    level: set[int],
) -> observations.KnownLines:
    length, start, end = np.array(lines.length_m), list(lines.start), list(lines.end)
    for row, value in length_m.items():
        length[row] = value
    for row, (first, last) in ends.items():
        start[row], end[row] = first, last
    along = lines.along
    if level:
        every = range(len(start))
        along = tuple("horizontal" if k in level else lines.along_of(k) for k in every)
    return replace(lines, length_m=length, start=tuple(start), end=tuple(end), along=along)


def plate_outline(targets: TargetOptions) -> Floats:
    """Return corners (4, 2) of a plate [m]; for a ChArUco board, its outermost inner corners."""
    if targets.side_m is not None:
        return SQUARE * targets.side_m
    from uavgram.config.board_text import parse_board  # noqa: PLC0415 - slow to load

    board = parse_board(targets.family)
    return SQUARE * board.square_m * [board.columns - 1, board.rows - 1]


def append_plate_sides(
    lines: observations.KnownLines, picks: observations.Picks, targets: TargetOptions | None
) -> observations.KnownLines:
    """Add the lengths of the plates that were found.

    Parameters
    ----------
    lines, picks
        Lengths and picks of the project.
    targets
        Its plates; None: it has none.
    """
    if targets is None:
        return lines
    return add_plate_sides(lines, picks, plate_outline(targets), targets.sigma_m)


def plate_scale(targets: TargetOptions | None) -> tuple[tuple[str, float], ...]:
    """Return name and prior of the common scale of all plates."""
    return () if targets is None else make_scale_prior(plate_outline(targets), targets.sigma_m)


def append_position_lines(inputs: Inputs, world: World) -> tuple[Inputs, tuple[Message, ...]]:
    """Append the lines of known position to the known things.

    Where the world is not tied to the earth, lines with latitude and longitude are left out, with a
    message.
    """
    lines = inputs.control_lines
    if not lines.name:
        return inputs, ()
    ends, messages = transform_known(inputs, _ends(lines, world), world)
    if not ends.label:
        return inputs, messages
    has_height = np.isfinite(lines.coordinates[:, 0, 2])
    placed = [
        observations.LinePosition(
            ends_m=_drop_height(place, has_height=high),
            sigma_m=np.nan_to_num(sigma),
            straightness_m=float(own),
            has_height=bool(high),
        )
        for place, sigma, own, high in zip(
            ends.world_m.reshape(-1, 2, 3),
            lines.sigma_m,
            lines.straightness_m,
            has_height,
            strict=True,
        )
    ]
    known, none = inputs.known, (None,) * len(inputs.known.name)
    count = len(lines.name)
    joined = observations.KnownThings(
        name=(*known.name, *lines.name),
        kind=(*known.kind, *(observations.ON_LINE,) * count),
        points=(*known.points, *lines.points),
        value=np.concatenate([known.value, np.full(count, np.nan)]),
        sigma=np.concatenate([known.sigma, [line.across_m for line in placed]]),
        adjust=np.concatenate([known.adjust, lines.adjust]),
        parameters=(*known.parameters, *((),) * count),
        position=(*none, *placed),
    )
    return replace(inputs, known=joined), ()


def _ends(lines: observations.ControlLines, world: World) -> observations.KnownPoints:
    """Return starts and ends in turn; unknown heights are set to that of the origin.

    This has hardly an effect on the horizontal position: east and north of a place 100 m higher
    change by a factor of 1.6e-5.
    """
    coordinates = lines.coordinates.reshape(-1, 3).copy()
    origin = 0.0 if lines.kind == "local" or world.origin is None else world.origin[2]
    coordinates[np.isnan(coordinates[:, 2]), 2] = origin
    return observations.KnownPoints(
        label=tuple(name for name in lines.name for _ in range(2)),
        kind=lines.kind,
        coordinates=coordinates,
        sigma_m=np.nan_to_num(lines.sigma_m.reshape(-1, 3)),
    )


def _drop_height(place: Floats, *, has_height: bool) -> Floats:
    return place if has_height else place * [1.0, 1.0, 0.0]
