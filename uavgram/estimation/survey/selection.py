"""Selection of parts of a survey, with the indices of the kept observations."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uavgram.model.arrays import Bools, Ints, rows_of
from uavgram.model.frames import TelemetryPrior
from uavgram.model.survey import NO_SIGHTINGS, Sightings, Survey


@dataclass(frozen=True, eq=False)
class Selection:
    """Reduced survey, and the indices of its picks and lines in the whole one.

    Attributes
    ----------
    survey
        Survey without the picks left out, and without frames, labels, lines, known things and
        control points that lost all of theirs.
    pick_index, line_index, frame_index, label_index
        (P',), (L',), (F',), (K',) into the whole survey.
    chain_index, tie_index
        (T',), (T'',) points of its matches, and of its tie points.
    """

    survey: Survey
    pick_index: Ints
    line_index: Ints
    frame_index: Ints
    label_index: Ints
    chain_index: Ints
    tie_index: Ints


def select_picks(survey: Survey, keep: Bools) -> Selection:
    """Keep the picks in `keep` (P,), and everything that depends only on these."""
    picks = np.flatnonzero(keep)
    frames = np.union1d(survey.pick_frame[picks], _find_tied_frames(survey))
    labels, pick_label = np.unique(survey.pick_label[picks], return_inverse=True)
    new_label = np.full(len(survey.label), -1)
    new_label[labels] = np.arange(len(labels))
    new_frame = np.full(len(survey.frame_id), -1)
    new_frame[frames] = np.arange(len(frames))
    new_pick = np.full(len(survey.pick_frame), -1)
    new_pick[picks] = np.arange(len(picks))
    start, end = new_label[survey.line_start], new_label[survey.line_end]
    lines = np.flatnonzero((start >= 0) & (end >= 0))
    control = np.flatnonzero(new_label[survey.control_label] >= 0)
    matches, chains = _select_sightings(survey.matches, new_frame, new_pick)
    beside = survey.ties.constraints.reindex_labels(new_label)
    ties, tied = _select_sightings(replace(survey.ties, constraints=beside), new_frame, new_pick)
    reduced = replace(
        survey,
        frame_id=tuple(survey.frame_id[i] for i in frames),
        **rows_of(survey, frames, "f"),
        seeds=None if survey.seeds is None else survey.seeds.take(frames),
        telemetry=_select_telemetry(survey, new_frame),
        rolling=survey.rolling and replace(survey.rolling, **rows_of(survey.rolling, frames, "f")),
        **rows_of(survey, labels, "k"),
        **rows_of(survey, picks, "p")
        | {"pick_frame": new_frame[survey.pick_frame[picks]], "pick_label": pick_label},
        target_pick=new_pick[survey.target_pick][new_pick[survey.target_pick] >= 0],
        matches=matches,
        ties=ties,
        **_select_some_lines(survey, lines) | {"line_start": start[lines], "line_end": end[lines]},
        known=tuple(one for old in survey.known if (one := old.relabel(new_label)) is not None),
        **rows_of(survey, control, "c")
        | {"control_label": new_label[survey.control_label[control]]},
    )
    return Selection(reduced, picks, lines, frames, labels, chains, tied)


def _find_tied_frames(survey: Survey) -> Ints:
    """Return the frames with sightings of tie points but without any pick."""
    tied = np.union1d(survey.matches.frame, survey.ties.frame)
    return np.setdiff1d(tied, survey.pick_frame)


def _select_sightings(
    sightings: Sightings, new_frame: Ints, new_pick: Ints
) -> tuple[Sightings, Ints]:
    """Keep sightings in kept frames, of chains whose pick is kept, with new indices (-1: left out).

    Also returns the indices of the kept points.
    """
    if not sightings.points:
        return sightings, np.zeros(0, dtype=np.int64)
    pick = np.where(sightings.pick < 0, -1, new_pick[sightings.pick])
    gone = (sightings.pick >= 0) & (pick < 0)
    out = (new_frame[sightings.frame] < 0) | gone[sightings.point]
    some, points = replace(sightings, pick=pick).remove(out)
    return replace(some, frame=new_frame[some.frame]), points


def select_lines(survey: Survey, keep: Bools) -> Survey:
    """Keep the known lengths in `keep` (L,), and everything else."""
    return replace(survey, **_select_some_lines(survey, np.flatnonzero(keep)))


def select_control(survey: Survey, keep: Bools) -> Survey:
    """Keep the control points in `keep` (C,), and everything else."""
    return replace(survey, **rows_of(survey, np.flatnonzero(keep), "c"))


def remove_known(survey: Survey, left_out: Collection[int]) -> Survey:
    """Leave out known things, by their number among the project's."""
    return replace(survey, known=tuple(one for one in survey.known if one.index not in left_out))


def remove_ties(survey: Survey, frames: Collection[str]) -> Survey:
    """Leave out the matches and tie points in some frames, by name."""
    out = np.isin(survey.frame_id, list(frames))
    matches, _ = survey.matches.remove(out[survey.matches.frame])
    ties, _ = survey.ties.remove(out[survey.ties.frame])
    return replace(survey, matches=matches, ties=ties)


def replace_matches_by_picks(survey: Survey) -> Survey:
    """Return the survey with a pick, after its own, for each label that a photo shows by a match.

    A match is the place of a picked pixel in another photo: it misses the label by the errors of
    the pick and of the match.
    """
    matches, labels = survey.matches, len(survey.label)
    if not matches.points:
        return survey
    origin = matches.pick[matches.point]
    label = survey.pick_label[origin]
    # Each label once in a frame, and not where it is picked: chains begin with their pick.
    pair, first = np.unique(matches.frame * labels + label, return_index=True)
    new = first[~np.isin(pair, survey.pick_frame * labels + survey.pick_label)]
    sigma = np.hypot(survey.pick_sigma_px[origin[new]], matches.sigma_px[new])
    return replace(
        survey,
        pick_frame=np.concatenate([survey.pick_frame, matches.frame[new]]),
        pick_label=np.concatenate([survey.pick_label, label[new]]),
        pixel_px=np.concatenate([survey.pixel_px, matches.pixel_px[new]]),
        pick_sigma_px=np.concatenate([survey.pick_sigma_px, sigma]),
        matches=NO_SIGHTINGS,
    )


def widen_poses(survey: Survey, factor: Mapping[str, float]) -> Survey:
    """Enlarge the sigmas of the log's poses of some photos.

    Parameters
    ----------
    survey
        All observations.
    factor
        Factor of the sigmas by the name of the photo.
    """
    prior = survey.telemetry
    if prior is None or not factor:
        return survey
    each = np.array([factor.get(survey.frame_id[k], 1.0) for k in prior.frame_index])
    covariance = prior.covariance * each[:, None, None] ** 2
    return replace(survey, telemetry=replace(prior, covariance=covariance))


def _select_some_lines(survey: Survey, lines: Ints) -> dict[str, Any]:
    texts = {name: getattr(survey, name) for name in ("line_name", "line_tape", "line_along")}
    some = {name: tuple(all_[i] for i in lines) if all_ else () for name, all_ in texts.items()}
    return rows_of(survey, lines, "l") | some


def _select_telemetry(survey: Survey, new_frame: Ints) -> TelemetryPrior | None:
    telemetry = survey.telemetry
    if telemetry is None:
        return None
    kept = np.flatnonzero(new_frame[telemetry.frame_index] >= 0)
    some = rows_of(telemetry, kept)
    return replace(telemetry, **some | {"frame_index": new_frame[some["frame_index"]]})
