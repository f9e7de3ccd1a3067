"""Find targets in a project's photos, coded and without a number, and write them as picks.

Targets without a number are identified by the search for picks (`uavgram picks match`), which knows
the region, and refuses ambiguous ones and those contradicted by other photos. Their centres are
measured in each photo, so that the errors of clicks are not repeated.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from uavgram.config.board_text import parse_board
from uavgram.errors import InputError, UavgramError
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.plates import detect_board_plate, detect_plates
from uavgram.imaging.targets.uncoded import Kind, UncodedTarget, measure_uncoded_target
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.naming import plate_of
from uavgram.model.observations import Picks, RejectedPlate, SeenPlate
from uavgram.model.options import TargetOptions
from uavgram.pipeline.match.adjustment import adjust_manual_picks
from uavgram.pipeline.match.search import Photos, load_grey_photos, search_all_photos
from uavgram.pipeline.measure.inputs import NO_PICKS, Inputs, find_project_duplicates, read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.parallel import Progress, prefetch, silent
from uavgram.pipeline.picks_table import lock_tables, save_picks
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.match import Pair, Record
from uavgram.stages.messages import order_messages
from uavgram.stages.plates import (
    TargetRow,
    add_targets,
    append_targets,
    list_requested_centers,
    remove_targets,
    target_row,
)

CLICK_PX = 2.5
"""Largest distance of a target's centre from its pick [px]; or three sigmas of the pick."""

SAME_PX = 1.0
"""Largest distance of a target's centre from the place by the surrounding picture [px]."""

ON_GROUND = 100.0
"""Odds that a target without a height is on the ground, where people usually place them."""

NOT_CLEAR = "no clear target there: hidden, shadowed, or too small"


@dataclass(frozen=True, kw_only=True)
class UncodedTargets:
    """Targets without a number that were found.

    Attributes
    ----------
    picks
        All picks of the project, with those of these targets.
    kinds
        Kind of target by label.
    found
        Other photos in which it was found, by label.
    """

    picks: Picks
    kinds: Mapping[str, str] = field(default_factory=dict)
    found: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    messages: tuple[Message, ...] = ()


NO_UNCODED = UncodedTargets(picks=NO_PICKS)


def find_uncoded(inputs: Inputs, progress: Progress) -> UncodedTargets:
    """Search for picked targets in the other photos.

    Parameters
    ----------
    inputs
        The project; its picks of targets are those that stay.
    progress
        Shows long loops.
    """
    photos = load_grey_photos(dict(zip(inputs.photos.frame_id, inputs.photos.path, strict=True)))
    own = _recognise(inputs, photos)
    if not own or len(inputs.photos.frame_id) < 2:
        return UncodedTargets(picks=inputs.picks)
    kinds = _kinds(inputs.picks, own)
    try:
        record = _search(inputs, photos, own, kinds, progress)
    except UavgramError as why:
        kind_names = {label: kind.value for label, kind in kinds.items()}
        return UncodedTargets(
            picks=inputs.picks,
            kinds=kind_names,
            messages=(_report_unplaced_targets(kind_names, why),),
        )
    rows, missed = _measure(inputs, photos, kinds, record)
    found = {label: tuple(r.image for r in rows if r.label == label) for label in kinds}
    return UncodedTargets(
        picks=append_targets(_remove_matches(inputs.picks, rows), rows),
        kinds={label: kind.value for label, kind in kinds.items()},
        found=found,
        messages=tuple(_report_missed_targets(missed, kinds)),
    )


def _recognise(inputs: Inputs, photos: Photos) -> dict[int, UncodedTarget]:
    """Recognise targets at picks by people, by number of the pick."""
    picks, found = inputs.picks, {}
    for i in np.flatnonzero(picks.of_source("hand")).tolist():
        if picks.image[i] not in inputs.photos.frame_id:
            continue
        photo, sigma = photos.get(picks.image[i]), float(picks.sigma_px[i])
        target = recognise_picked(photo, picks.label[i], picks.pixel_px[i], sigma)
        if target is not None:
            found[i] = target
    return found


def recognise_picked(
    photo: Image, label: str, pixel_px: Floats, sigma_px: float
) -> UncodedTarget | None:
    """Recognise a picked target; None where the pick is on none, or on a coded plate.

    Parameters
    ----------
    photo
        (height, width) grey.
    label
        Label of the pick.
    pixel_px, sigma_px
        (2,) its pixel; its sigma, NaN where unknown.
    """
    if plate_of(label) is not None:
        return None
    target = measure_uncoded_target(photo, pixel_px)
    reach = max(CLICK_PX, 3.0 * float(np.nan_to_num(sigma_px)))
    is_on = target is not None and np.hypot(*(target.pixel_px - pixel_px)) <= reach
    return target if is_on else None


def recognise_same(
    photo: Image, kind: Kind, place_px: Floats, sigma_px: float
) -> UncodedTarget | None:
    """Recognise a target of a kind where its surroundings were found; None if it is not clear.

    Parameters
    ----------
    photo
        (height, width) grey.
    kind
        Kind of the picked target.
    place_px, sigma_px
        (2,) place of its centre by the matching, and its sigma.
    """
    target = measure_uncoded_target(photo, place_px)
    if target is None or target.kind is not kind:
        return None
    off = np.hypot(*(target.pixel_px - place_px))
    return target if off <= SAME_PX + 3.0 * sigma_px else None


def make_pick_row(image: str, label: str, target: UncodedTarget, focal_px: float) -> TargetRow:
    """Return a pick of a target's centre.

    Parameters
    ----------
    image, label
        The photo, and the label.
    target
        The target in it.
    focal_px
        Focal length of the camera: the middle of a disc's outline is not the image of its middle.
    """
    sigma = float(np.hypot(target.sigma_px, target.off_center_px(focal_px)))
    u, v = target.pixel_px.tolist()
    return target_row(image, label, (u, v), sigma, target.score)


def _kinds(picks: Picks, own: Mapping[int, UncodedTarget]) -> dict[str, Kind]:
    """Return the kind of each label; none where its picks are on targets of several kinds."""
    kinds: dict[str, set[Kind]] = {}
    for i, target in own.items():
        kinds.setdefault(picks.label[i], set()).add(target.kind)
    return {label: next(iter(some)) for label, some in kinds.items() if len(some) == 1}


def _search(
    inputs: Inputs,
    photos: Photos,
    own: Mapping[int, UncodedTarget],
    kinds: Mapping[str, Kind],
    progress: Progress,
) -> Record:
    """Search for the pictures around the targets in the other photos.

    Parameters
    ----------
    inputs, photos, progress
        The project.
    own
        Targets at picks: the search starts from their centres.
    kinds
        Labels to search for.
    """
    pixel = inputs.picks.pixel_px.copy()
    for i, target in own.items():
        pixel[i] = target.pixel_px
    picks = replace(inputs.picks, pixel_px=pixel)
    picks = picks.where(~picks.of_source("match"))
    there = set(zip(picks.image, picks.label, strict=True))
    copies = set(find_project_duplicates(inputs).photos)
    base = adjust_manual_picks(replace(inputs, picks=picks), pose_frames(inputs))

    def wanted(pair: Pair) -> bool:
        return pair[1] in kinds and pair not in there and pair[0] not in copies

    return search_all_photos(base, photos, wanted, progress, ON_GROUND).record


def _measure(
    inputs: Inputs, photos: Photos, kinds: Mapping[str, Kind], record: Record
) -> tuple[list[TargetRow], dict[Pair, str]]:
    """Return rows of clear targets at the finds, and reasons for the others.

    Parameters
    ----------
    inputs, photos
        The project.
    kinds
        Kind of each label.
    record
        Record of the search.
    """
    rows, missed = [], dict(record.in_vain)
    for pair, found in sorted(record.found.items()):
        image, label = pair
        place = np.array(found.pixel_px)
        target = recognise_same(photos.get(image), kinds[label], place, found.sigma_px)
        if target is None:
            missed[pair] = NOT_CLEAR
            continue
        rows.append(make_pick_row(image, label, target, float(inputs.calibration.parameters[0])))
    return rows, missed


def _remove_matches(picks: Picks, rows: list[TargetRow]) -> Picks:
    """Remove matches where the target itself is now picked, which is better."""
    new = {(row.image, row.label) for row in rows}
    pairs = zip(picks.image, picks.label, strict=True)
    there = np.array([pair in new for pair in pairs], dtype=np.bool_)
    return picks.where(~(there & picks.of_source("match")))


def _report_unplaced_targets(kinds: Mapping[str, str], why: Exception) -> Message:
    some = ", ".join(f"{label} ({kind})" for label, kind in list(kinds.items())[:5])
    text = (
        f"Targets that you picked ({some}) were not searched for in the other photos, as the "
        f"relation between the photos is not known: {why}"
    )
    return Message("warning", "target-not-sought", text)


def _report_missed_targets(
    missed: Mapping[Pair, str], kinds: Mapping[str, Kind]
) -> Iterator[Message]:
    for label, kind in kinds.items():
        own = {image: why for (image, name), why in missed.items() if name == label}
        if own:
            places = "; ".join(f"{image}: {why}" for image, why in sorted(own.items()))
            text = (
                f"{label}, a {kind.value}, was looked for but not taken in {len(own)} photos "
                f"({places}). Pick it there by hand where you see it."
            )
            yield Message("info", "target-not-found", text, frames=tuple(sorted(own)))


Sight = Callable[[Image], tuple[SeenPlate, ...]]


@dataclass(frozen=True, kw_only=True)
class FoundTargets:
    """Targets that were found, and written unless in a dry run.

    Attributes
    ----------
    path
        The table of picks.
    rows, removed
        Numbers of rows of targets in it now, and before.
    plates
        For each plate, the photos that show it, and the shortest side there [px].
    photos
        Number of photos that were searched.
    uncoded
        Targets without a number.
    """

    path: Path
    rows: int
    removed: int
    plates: dict[int, tuple[tuple[str, float], ...]]
    photos: int
    messages: tuple[Message, ...]
    uncoded: UncodedTargets = NO_UNCODED


@limit_blas_threads
def find_targets(
    project: str | os.PathLike[str], *, dry_run: bool = False, progress: Progress = silent
) -> FoundTargets:
    """Find the project's plates in all of its photos, and targets that are picked in one.

    The rows of an earlier search are replaced; those by people are unchanged.

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
        A problem that the user can solve. The table is unchanged.
    """
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    with nullcontext() if dry_run else lock_tables(inputs.project, inputs.project_path):
        seen = dict(_detect_all_plates(inputs, progress))
        numbers = {
            p.plate for plates in seen.values() for p in plates if p.left_out is RejectedPlate.NO
        }
        named, known = list_named_points(inputs)
        centers = list_requested_centers(numbers, named, known, inputs.picks)
        rows = add_targets(inputs.picks, seen, centers)
        uncoded = find_uncoded(replace(inputs, picks=rows.picks), progress)
        if inputs.project.targets is None and not uncoded.kinds:
            raise _make_no_targets_error(inputs)
        path = Path(inputs.project.picks) if dry_run else save_picks(inputs, uncoded.picks)
    return FoundTargets(
        path=path,
        rows=int(uncoded.picks.of_source("target").sum()),
        removed=int(inputs.picks.of_source("target").sum()),
        plates={number: tuple(_photos_of(number, seen)) for number in sorted(numbers)},
        photos=len(inputs.photos.path),
        messages=order_messages(
            *rows.messages, *_report_no_plates(rows.plates, inputs), *uncoded.messages
        ),
        uncoded=uncoded,
    )


def undo_targets(project: str | os.PathLike[str], *, dry_run: bool = False) -> FoundTargets:
    """Remove all rows of targets from a project's picks.

    Parameters
    ----------
    project, dry_run
        As for `find_targets`.

    Raises
    ------
    UavgramError
        A problem that the user can solve. The table is unchanged.
    """
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    path = Path(inputs.project.picks)
    after = remove_targets(inputs.picks)
    if not dry_run:
        with lock_tables(inputs.project, inputs.project_path):
            path = save_picks(inputs, after)
    removed = len(inputs.picks.image) - len(after.image)
    return FoundTargets(path=path, rows=0, removed=removed, plates={}, photos=0, messages=())


def _make_no_targets_error(inputs: Inputs) -> InputError:
    return InputError(
        inputs.project_path,
        "names no targets: add the family of your plates and the side of the black "
        "square, as in `targets: {family: aruco-4x4-50, side_m: 0.60, sigma_m: 0.001}`. Chequers, "
        "crosses and discs need none of that: pick each in one photo (no pick of yours is on one)",
    )


def _sight(targets: TargetOptions) -> Sight:
    if targets.is_board:
        board = parse_board(targets.family)
        return lambda image: detect_board_plate(image, board)
    return lambda image: detect_plates(image, targets.family)


def _detect_all_plates(
    inputs: Inputs, progress: Progress
) -> Iterator[tuple[str, tuple[SeenPlate, ...]]]:
    if inputs.project.targets is None:
        return
    sight = _sight(inputs.project.targets)
    photos = dict(zip(inputs.photos.path, inputs.photos.frame_id, strict=True))
    found = prefetch(lambda path: sight(read_grey(path)), photos)
    for path, plates in progress(found, "looking for targets", len(photos)):
        yield photos[path], plates


def list_named_points(inputs: Inputs) -> tuple[set[str], set[str]]:
    """Return labels in lengths, measurements and known things, and those of known coordinates."""
    lines, known = inputs.lines, inputs.known
    points_of = (*known.points, *inputs.control_lines.points)
    named = {*lines.start, *lines.end, *(p for points in points_of for p in points)}
    named |= {point for request in inputs.requests for point in request.points}
    return named, {*inputs.control.label, *inputs.check.label}


def _photos_of(number: int, seen: dict[str, tuple[SeenPlate, ...]]) -> Iterator[tuple[str, float]]:
    for image, plates in seen.items():
        for plate in plates:
            if plate.plate == number and plate.left_out is RejectedPlate.NO:
                yield image, plate.side_px


def _report_no_plates(plates: int, inputs: Inputs) -> Iterator[Message]:
    targets = inputs.project.targets
    if plates or targets is None:
        return
    text = (
        f"No plate of the family {targets.family} was found in any of the "
        f"{len(inputs.photos.path)} photos. Check whether `targets: family` names the printed "
        "family, and whether their black squares are 16 pixels wide or more in the photos."
    )
    yield Message("warning", "no-target", text)
