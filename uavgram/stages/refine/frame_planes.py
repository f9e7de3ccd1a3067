"""Planes under single frames, from which a survey without a log begins; or the missing inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from scipy.special import chdtri

from uavgram.estimation.first_poses.first_values import count_lines_per_frame, estimate_length_poses
from uavgram.estimation.first_poses.known_frames import (
    FrameThings,
    find_frame_things,
    find_known_planes,
)
from uavgram.estimation.first_poses.length_poses import OUTSIDE_PROBABILITY
from uavgram.estimation.first_poses.shared_plane import find_shared_planes
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey


class FramePlanes(NamedTuple):
    """Planes and known things of the frames of a survey.

    Attributes
    ----------
    seen
        Known things in each frame with more than lengths.
    counts
        (F,) number of equations for each frame's pose.
    planes
        Planes (n, 3), likeliest first, of the frames that have any.
    """

    seen: Mapping[int, FrameThings]
    counts: Ints
    planes: dict[int, Floats]


def find_frame_planes(survey: Survey, ray: Floats) -> FramePlanes:
    """Find the planes of all frames.

    Parameters
    ----------
    survey
        The observations.
    ray
        (P, 3) undistorted rays of its picks, z = 1.
    """
    seen = find_frame_things(survey)
    counts = count_lines_per_frame(survey)
    for frame, known in seen.items():
        counts[frame] = known.rows
    return FramePlanes(seen, counts, _planes(survey, ray, seen, counts))


def _planes(
    survey: Survey, ray: Floats, seen: Mapping[int, FrameThings], counts: Ints
) -> dict[int, Floats]:
    """Find planes (n, 3) of frames; contradictory frames only where there are no others.

    A frame whose lengths determine its pose needs no more than these. Where no frame has a plane of
    its own, two that share points of the ground have one.

    Parameters
    ----------
    survey, ray
        As for `frame_planes`.
    seen, counts
        As in `FramePlanes`.
    """
    lines = count_lines_per_frame(survey)
    by_lengths = estimate_length_poses(survey)
    determined = [f for f, found in by_lengths.items() if found.converged.any()]
    by_things = find_known_planes(survey, ray, seen, determined)
    candidates = {
        **{f: (found.plane, found.cost[0], lines[f]) for f, found in by_lengths.items()},
        **{f: (found.plane, found.cost[0], counts[f]) for f, found in by_things.items()},
    }
    kept = {
        f: plane
        for f, (plane, cost, count) in candidates.items()
        if cost <= float(chdtri(max(count - 3, 1), OUTSIDE_PROBABILITY))
    }
    every = kept or {f: plane for f, (plane, _, _) in candidates.items()}
    return every or find_shared_planes(survey, ray)


def describe_missing_input(survey: Survey, found: FramePlanes) -> str:
    """Describe the missing input of a survey with neither log nor a frame with a plane."""
    seen, counts = found.seen, found.counts
    if not seen:
        return (
            "nothing shows where the photos were taken. Without a flight log, mark both ends of "
            "three known lengths in one photo "
            f"(most so far: {counts.max()} in {survey.frame_id[int(counts.argmax())]!r}), or one "
            "known length and six points of known height in two photos"
        )
    frame = max(seen, key=lambda f: (seen[f].scaled, seen[f].rows, -f))
    known, name = seen[frame], survey.frame_id[frame]
    more = "a length, a right angle, a pair of parallel lines or of equal lengths"
    if not known.scaled:
        lack = "none fixes the scale: give a length there"
    elif known.rows < 3:
        missing = "two more are" if known.rows == 1 else "one more is"
        lack = f"{missing} missing there: {more}"
    else:
        lack = (
            "but they do not fix the camera's position: they repeat or contradict each "
            "other, or two of the positions that they allow merge; check them, or give one more "
            f"there, best in another direction: {more}"
        )
    return (
        "without a flight log a photo is placed by three things known of points on the ground "
        f"that it shows whole, a length among them; {name!r} shows {known.words()}: {lack}; or "
        "give the log"
    )
