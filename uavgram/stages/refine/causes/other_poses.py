"""Find corrections with which all lengths of a photo fit in another pose.

Wrong lengths, and lengths between wrong labels, distort the pose of a photo that they place, and so
all of its points: its present state does not show which correction is right. Hence each correction
gets a pose of its own. All are estimated together, as if each were a photo with points and lengths
of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.first_values import estimate_length_poses
from uavgram.estimation.first_poses.length_poses import compare_with_seed
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Diagnosis, correct_survey, find_usable_picks

MOST_PHOTOS = 2
"""Number of photos up to which a wrong one, or wrong lengths without a log, distort the points."""


def needs_other_poses(diagnosis: Diagnosis) -> bool:
    """Return whether the present state is of no use: lengths place it, or it is no minimum."""
    usable = find_usable_picks(diagnosis.taking)
    photos = len(np.unique(diagnosis.survey.pick_frame[usable]))
    most = 1 if diagnosis.survey.telemetry is not None else MOST_PHOTOS
    return photos <= most or not diagnosis.adjustment.minimum.converged


def find_picks_of_photo(diagnosis: Diagnosis) -> Ints:
    """Find the usable picks (n,) of the photo, or of the one with most picks."""
    frame = diagnosis.survey.pick_frame
    usable = find_usable_picks(diagnosis.taking)
    return np.flatnonzero(usable & (frame == np.bincount(frame[usable]).argmax()))


def compute_decreases(
    diagnosis: Diagnosis, picks: Ints, corrections: Sequence[SurveyCorrection]
) -> Floats:
    """Compute the decrease (C,) of the sum of squares with each correction, in the best pose.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    picks
        (n,) picks of the photo.
    corrections
        C corrections; -inf where no pose fits.
    """
    survey = diagnosis.survey
    frame, least = int(survey.pick_frame[picks[0]]), np.full(len(corrections), np.inf)
    for k, poses in estimate_length_poses(_stack(survey, picks, corrections)).items():
        cost = poses.cost
        if survey.seeds is not None:
            compared = compare_with_seed(
                survey.seeds.center_world_m[frame],
                survey.seeds.world_from_camera[frame],
                survey.seeds.covariance[frame],
                survey.ground,
                poses,
            )
            cost = cost + compared.squared_distance
        least[k] = np.min(cost[poses.converged], initial=np.inf)
    return np.asarray(diagnosis.cost - least)


def _stack(survey: Survey, picks: Ints, corrections: Sequence[SurveyCorrection]) -> Survey:
    """Return a photo once for each correction, each with points and lengths of its own."""
    each = [correct_survey(survey, one) for one in corrections]
    cases = len(each)
    label = np.stack([one.pick_label[picks] for one in each])
    start = np.stack([one.line_start for one in each])
    end = np.stack([one.line_end for one in each])
    first = len(survey.label) * np.arange(cases)[:, None]
    return replace(
        survey,
        frame_id=tuple(map(str, range(cases))),
        time_s=np.zeros(0),
        time_sigma_s=np.zeros(0),
        label=tuple(map(str, range(cases * len(survey.label)))),
        pick_frame=np.repeat(np.arange(cases), len(picks)),
        pick_label=(label + first).ravel(),
        pixel_px=np.tile(survey.pixel_px[picks], (cases, 1)),
        pick_sigma_px=np.tile(survey.pick_sigma_px[picks], cases),
        target_pick=np.zeros(0, dtype=np.int64),
        identification_sigma_m=np.zeros(0),
        line_name=(),
        line_tape=(),
        line_along=(),
        line_start=(start + first).ravel(),
        line_end=(end + first).ravel(),
        length_m=np.concatenate([one.length_m for one in each]),
        length_sigma_m=np.tile(survey.length_sigma_m, cases),
        area=np.tile(survey.area, cases),
        height_above_m=np.tile(survey.height_above_m, cases),
        height_sigma_m=np.tile(survey.height_sigma_m, cases),
        is_free=np.concatenate([one.is_free for one in each]),
    )
