"""Find coded plates and other targets in a project's photos, and write them into its picks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.config.board_text import parse_board
from uavgram.errors import InputError
from uavgram.imaging.plates.board import sight_board_plate
from uavgram.imaging.plates.sight import sight_plates
from uavgram.imaging.raster import Image
from uavgram.io.photos.board_photos import read_grey
from uavgram.model.message import Message
from uavgram.model.options import TargetOptions
from uavgram.model.survey.plates import LeftOut, SeenPlate
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.parallel import prefetch
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.saved_picks import save_picks, sole_writer
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.pipeline.uncoded_targets import NO_UNCODED, UncodedTargets, uncoded_targets
from uavgram.stages.messages import in_order
from uavgram.stages.target_rows import asked_centers, with_targets, without_targets

Sight = Callable[[Image], tuple[SeenPlate, ...]]


@dataclass(frozen=True, kw_only=True)
class FoundTargets:
    """What was found, and written unless it was only asked for.

    Attributes
    ----------
    path
        The table of picks.
    rows, removed
        Rows of targets that it has now; that it had before.
    plates
        For each plate, the photos that show it, and the shortest side there [px].
    photos
        Number of photos that were looked at.
    uncoded
        What was found of labels that are targets without a number.
    """

    path: Path
    rows: int
    removed: int
    plates: dict[int, tuple[tuple[str, float], ...]]
    photos: int
    messages: tuple[Message, ...]
    uncoded: UncodedTargets = NO_UNCODED


@with_one_blas_thread
def find_targets(
    project: str | os.PathLike[str], *, dry_run: bool = False, progress: Progress = silent
) -> FoundTargets:
    """Look for the project's plates in all of its photos, and for targets that are picked in one.

    The rows of an earlier search are replaced; those that a person made stay as they are.

    Parameters
    ----------
    project
        The project file.
    dry_run
        Write nothing.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve. The table is as it was.
    """
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    with nullcontext() if dry_run else sole_writer(inputs.project, inputs.project_path):
        seen = dict(_seen(inputs, progress))
        numbers = {p.plate for plates in seen.values() for p in plates if p.left_out is LeftOut.NO}
        named, known = named_points(inputs)
        centers = asked_centers(numbers, named, known, inputs.picks)
        rows = with_targets(inputs.picks, seen, centers)
        uncoded = uncoded_targets(replace(inputs, picks=rows.picks), progress)
        if inputs.project.targets is None and not uncoded.kinds:
            raise _no_targets(inputs)
        path = Path(inputs.project.picks) if dry_run else save_picks(inputs, uncoded.picks)
    return FoundTargets(
        path=path,
        rows=int(uncoded.picks.of_source("target").sum()),
        removed=int(inputs.picks.of_source("target").sum()),
        plates={number: tuple(_photos_of(number, seen)) for number in sorted(numbers)},
        photos=len(inputs.photos.path),
        messages=in_order(*rows.messages, *_nothing_found(rows.plates, inputs), *uncoded.messages),
        uncoded=uncoded,
    )


def undo_targets(project: str | os.PathLike[str], *, dry_run: bool = False) -> FoundTargets:
    """Take all rows of targets out of a project's picks.

    Parameters
    ----------
    project, dry_run
        As of `find_targets`.

    Raises
    ------
    UavgramError
        A problem that the user can solve. The table is as it was.
    """
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    path = Path(inputs.project.picks)
    after = without_targets(inputs.picks)
    if not dry_run:
        with sole_writer(inputs.project, inputs.project_path):
            path = save_picks(inputs, after)
    removed = len(inputs.picks.image) - len(after.image)
    return FoundTargets(path=path, rows=0, removed=removed, plates={}, photos=0, messages=())


def _no_targets(inputs: Inputs) -> InputError:
    return InputError(
        inputs.project_path,
        "names no targets: add what is printed on your plates and the side of the black "
        "square, as in `targets: {family: aruco-4x4-50, side_m: 0.60, sigma_m: 0.001}`. Chequers, "
        "crosses and discs need none of that: pick each in one photo (no pick of yours is on one)",
    )


def _sight(targets: TargetOptions) -> Sight:
    if targets.is_board:
        board = parse_board(targets.family)
        return lambda image: sight_board_plate(image, board)
    return lambda image: sight_plates(image, targets.family)


def _seen(inputs: Inputs, progress: Progress) -> Iterator[tuple[str, tuple[SeenPlate, ...]]]:
    if inputs.project.targets is None:
        return
    sight = _sight(inputs.project.targets)
    photos = dict(zip(inputs.photos.path, inputs.photos.frame_id, strict=True))
    found = prefetch(lambda path: sight(read_grey(path)), photos)
    for path, plates in progress(found, "looking for targets", len(photos)):
        yield photos[path], plates


def named_points(inputs: Inputs) -> tuple[set[str], set[str]]:
    """Labels that lengths, measurements and known things name, and those of known coordinates."""
    lines, known = inputs.lines, inputs.known
    points_of = (*known.points, *inputs.control_lines.points)
    named = {*lines.start, *lines.end, *(p for points in points_of for p in points)}
    named |= {point for request in inputs.requests for point in request.points}
    return named, {*inputs.control.label, *inputs.check.label}


def _photos_of(number: int, seen: dict[str, tuple[SeenPlate, ...]]) -> Iterator[tuple[str, float]]:
    for image, plates in seen.items():
        for plate in plates:
            if plate.plate == number and plate.left_out is LeftOut.NO:
                yield image, plate.side_px


def _nothing_found(plates: int, inputs: Inputs) -> Iterator[Message]:
    targets = inputs.project.targets
    if plates or targets is None:
        return
    text = (
        f"No plate of the family {targets.family} was found in any of the "
        f"{len(inputs.photos.path)} photos. Look whether `targets: family` names what is "
        "printed on them, and whether their black squares are 16 pixels wide or more in the photos."
    )
    yield Message("warning", "no-target", text)
