"""Find a project's picks in its other photos, and write the finds into picks.csv."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.errors import GeometryError, UavgramError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.motion.telemetry_pose import BORESIGHT
from uavgram.model.arrays import Bools
from uavgram.pipeline.match.adjustment import Base, begun
from uavgram.pipeline.match.patch_search import grey_photos
from uavgram.pipeline.match.search import searched
from uavgram.pipeline.match.selection import (
    Asked,
    check_asked,
    check_undone,
    earlier,
    labels_by_hand,
    still_founded,
    with_found,
)
from uavgram.pipeline.measure.inputs import Inputs, duplicates_of, read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.picks_table import save_picks, sole_writer
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.match import Matches, Pair, measure_rotation_rad


@dataclass(frozen=True)
class Undone:
    """Number of matches removed from a table."""

    path: Path
    removed: int


@with_one_blas_thread
def match_picks(
    project: str | os.PathLike[str],
    asked: Asked | None = None,
    *,
    dry_run: bool = False,
    progress: Progress = silent,
) -> Matches:
    """Search for the picks by people in all other photos.

    Picks by people are unchanged. So are existing matches, including accepted ones, except those
    whose pick was moved, or that no longer fit; these are searched again.

    Parameters
    ----------
    project
        The project file, or its folder.
    asked
        Only these labels and photos.
    dry_run
        Write nothing.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve. The table is unchanged.
    """
    asked = asked or Asked()
    inputs = read_inputs(Path(project))
    check_asked(inputs, asked)
    with nullcontext() if dry_run else sole_writer(inputs.project, inputs.project_path):
        before = earlier(inputs.picks, asked)
        gone = before & ~still_founded(inputs.picks)
        base, unfit = _begun(inputs, ~gone).without_unfit(before[~gone])
        photos = dict(zip(inputs.photos.frame_id, inputs.photos.path, strict=True))
        search = searched(base, grey_photos(photos), _wanted(base, asked), progress)
        picks = with_found(base.inputs.picks, search.record.found)
        path = Path(inputs.project.picks) if dry_run else save_picks(inputs, picks)
    from_labels = {base.inputs.picks.label[i] for i in base.sources(search.adjustment)}
    labels = _sought(inputs, asked)
    return Matches(
        path=str(path),
        record=search.record,
        labels=tuple(label for label in labels if label in from_labels),
        picks=picks,
        replaced=int(gone.sum() + unfit.sum()),
        kept=int(before.sum() - gone.sum() - unfit.sum()),
        not_sought=tuple(label for label in labels if label not in from_labels),
        unplaced=_unplaced(base, search.adjustment, asked),
        turned_rad=_turned_rad(search.adjustment),
    )


def undo_matches(
    project: str | os.PathLike[str], asked: Asked | None = None, *, dry_run: bool = False
) -> Undone:
    """Remove matches from a project's picks.

    Parameters
    ----------
    project, asked, dry_run
        As for `match_picks`.

    Raises
    ------
    UavgramError
        A problem that the user can solve. The table is unchanged.
    """
    asked = asked or Asked()
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    check_undone(inputs, asked)
    stays = ~earlier(inputs.picks, asked)
    path = Path(inputs.project.picks)
    if not dry_run:
        with sole_writer(inputs.project, inputs.project_path):
            path = save_picks(inputs, with_found(inputs.picks, {}, keep=stays))
    return Undone(path, int((~stays).sum()))


def _sought(inputs: Inputs, asked: Asked) -> tuple[str, ...]:
    by_hand = labels_by_hand(inputs.picks)
    return tuple(label for label in by_hand if not asked.labels or label in asked.labels)


def _begun(inputs: Inputs, stays: Bools) -> Base:
    """Return the project without replaced matches, with the picks by people adjusted."""
    try:
        picks = with_found(inputs.picks, {}, keep=stays)
        return begun(replace(inputs, picks=picks), pose_frames(inputs))
    except GeometryError as why:
        raise UavgramError(
            f"{inputs.project_path}: no search is possible yet, as the relation between the photos "
            f"is not known: {why}"
        ) from why


def _wanted(base: Base, asked: Asked) -> Callable[[Pair], bool]:
    """Return a test whether a label is sought in a photo: requested, and without a pick there."""
    picks = base.inputs.picks
    there = set(zip(picks.image, picks.label, strict=True))
    copies = duplicates_of(base.inputs).photos
    return lambda pair: pair not in there and pair[0] not in copies and asked.has(pair)


def _turned_rad(adjustment: Adjustment) -> float:
    prior = adjustment.survey.telemetry
    if prior is None:
        return 0.0
    return measure_rotation_rad(adjustment.state.telemetry[BORESIGHT], prior.boresight_sigma_rad)


def _unplaced(base: Base, adjustment: Adjustment, asked: Asked) -> tuple[str, ...]:
    telemetry = base.posed.telemetry
    placed = {*adjustment.survey.frame_id, *(() if telemetry is None else telemetry.poses.frame_id)}
    placed |= set(duplicates_of(base.inputs).photos)
    names = asked.photos or base.inputs.photos.frame_id
    return tuple(name for name in names if name not in placed)
