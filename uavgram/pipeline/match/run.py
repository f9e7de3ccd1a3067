"""Find a project's picks in its other photos, and write the finds into picks.csv."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.errors import GeometryError, UavgramError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.motion.camera_motion import BORESIGHT
from uavgram.model.arrays import Bools
from uavgram.pipeline.match.adjustment import BaseAdjustment, adjust_manual_picks
from uavgram.pipeline.match.search import Search, load_grey_photos, search_all_photos
from uavgram.pipeline.match.selection import (
    Selection,
    append_matches,
    check_matches_exist,
    check_selection,
    list_manual_labels,
    mark_existing_matches,
    mark_valid_matches,
)
from uavgram.pipeline.measure.inputs import Inputs, find_project_duplicates, read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.picks_table import lock_tables, save_picks
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.match import Matches, Pair, measure_rotation_rad


@dataclass(frozen=True)
class RemovedMatches:
    """Number of matches removed from a table."""

    path: Path
    removed: int


@limit_blas_threads
def match_picks(
    project: str | os.PathLike[str],
    asked: Selection | None = None,
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
    asked = asked or Selection()
    inputs = read_inputs(Path(project))
    check_selection(inputs, asked)
    with nullcontext() if dry_run else lock_tables(inputs.project, inputs.project_path):
        before = mark_existing_matches(inputs.picks, asked)
        gone = before & ~mark_valid_matches(inputs.picks)
        base, unfit = _adjust_base(inputs, ~gone).remove_unfit(before[~gone])
        photos = dict(zip(inputs.photos.frame_id, inputs.photos.path, strict=True))
        search = search_all_photos(
            base, load_grey_photos(photos), _make_filter(base, asked), progress
        )
        picks = append_matches(base.inputs.picks, search.record.found)
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
        unplaced=_find_unplaced_photos(base, search, asked),
        turned_rad=_measure_turn_rad(search.adjustment),
    )


def undo_matches(
    project: str | os.PathLike[str], asked: Selection | None = None, *, dry_run: bool = False
) -> RemovedMatches:
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
    asked = asked or Selection()
    inputs = read_inputs(Path(project), unfinished=True, unpicked=True)
    check_matches_exist(inputs, asked)
    stays = ~mark_existing_matches(inputs.picks, asked)
    path = Path(inputs.project.picks)
    if not dry_run:
        with lock_tables(inputs.project, inputs.project_path):
            path = save_picks(inputs, inputs.picks.where(stays))
    return RemovedMatches(path, int((~stays).sum()))


def _sought(inputs: Inputs, asked: Selection) -> tuple[str, ...]:
    by_hand = list_manual_labels(inputs.picks)
    return tuple(label for label in by_hand if not asked.labels or label in asked.labels)


def _adjust_base(inputs: Inputs, stays: Bools) -> BaseAdjustment:
    """Return the project without replaced matches, with the picks by people adjusted."""
    try:
        picks = inputs.picks.where(stays)
        return adjust_manual_picks(replace(inputs, picks=picks), pose_frames(inputs))
    except GeometryError as why:
        raise UavgramError(
            f"{inputs.project_path}: no search is possible yet, as the relation between the photos "
            f"is not known: {why}"
        ) from why


def _make_filter(base: BaseAdjustment, asked: Selection) -> Callable[[Pair], bool]:
    """Return a test whether a label is sought in a photo: requested, and without a pick there."""
    picks = base.inputs.picks
    there = set(zip(picks.image, picks.label, strict=True))
    copies = find_project_duplicates(base.inputs).photos
    return lambda pair: pair not in there and pair[0] not in copies and asked.has(pair)


def _measure_turn_rad(adjustment: Adjustment) -> float:
    prior = adjustment.survey.telemetry
    if prior is None:
        return 0.0
    return measure_rotation_rad(adjustment.state.telemetry[BORESIGHT], prior.boresight_sigma_rad)


def _find_unplaced_photos(
    base: BaseAdjustment, search: Search, asked: Selection
) -> tuple[str, ...]:
    """Return photos that were not searched, as neither poses nor features predict a pick there."""
    telemetry, record = base.posed.telemetry, search.record
    placed = {image for image, _ in (*record.found, *record.missed)}
    placed |= {*search.adjustment.survey.frame_id}
    placed |= set(() if telemetry is None else telemetry.poses.frame_id)
    placed |= set(find_project_duplicates(base.inputs).photos)
    names = asked.photos or base.inputs.photos.frame_id
    return tuple(name for name in names if name not in placed)
