"""Picks looked for in the other photos, round by round, each with the poses of the last."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import FlightOfPhotos
from uavgram.estimation.measuring.transferred_pixels import Clicked, Transferred, transferred
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.imaging.matching.matched import Sought
from uavgram.model.arrays import Ints
from uavgram.pipeline.match.adjusting import Base
from uavgram.pipeline.match.looking import Photos, look, reason, tasks
from uavgram.pipeline.progress import Progress, silent
from uavgram.stages.match.found import Found, Missed, Pair, Record
from uavgram.stages.match.plan import next_places, radii

MOST_ROUNDS = 10
"""Rounds of looking and adjusting."""

LEAST_PX = 0.5
"""Sigma that is added to every prediction: of what no adjustment knows, such as a lens's last
distortion."""

CONTRADICTED = "what looks like it lies where the other photos contradict it"


class Search(NamedTuple):
    """What was found and missed, and the last adjustment with it."""

    record: Record
    adjustment: Adjustment


def searched(
    base: Base, photos: Photos, wanted: Callable[[Pair], bool], progress: Progress = silent
) -> Search:
    """Look for picks in all photos until there is nothing left to try.

    Parameters
    ----------
    base
        The project, its own picks adjusted.
    photos
        Grey, by name.
    wanted
        Whether a label is to be looked for in a photo.
    progress
        Shows long loops.
    """
    adjustment, record = _agreeing(base, Record())
    for _ in range(MOST_ROUNDS):
        places, picks = _places(base, adjustment)
        pairs = _pairs(base, places, picks)
        asked = np.array([wanted(pair) for pair in pairs], dtype=np.bool_)
        rows = next_places(places, pairs, picks, asked, record)
        if not rows.size:
            break
        looked = _looked(photos, base, (places, picks), rows, progress)
        adjustment, record = _agreeing(base, record.with_results(looked))
    return Search(record, adjustment)


def _agreeing(base: Base, record: Record) -> tuple[Adjustment, Record]:
    """The adjustment with what was found, and the record without what it contradicts."""
    adjustment, wrong = base.adjusted(record.found)
    return adjustment, record.without(dict.fromkeys(sorted(wrong), CONTRADICTED))


def _places(base: Base, adjustment: Adjustment) -> tuple[Transferred, Ints]:
    """Where picks made by people should appear, and the number of the pick of each place."""
    survey, project = adjustment.survey, base.inputs.picks
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    label = {name: k for k, name in enumerate(survey.label)}
    taking = base.sources(adjustment)
    picks = np.array(taking, dtype=np.int64)
    clicked = Clicked(
        np.array([frame[project.image[i]] for i in taking], dtype=np.int64),
        np.array([label[project.label[i]] for i in taking], dtype=np.int64),
        project.pixel_px[picks].reshape(-1, 2),
    )
    places = transferred(adjustment, _flight(base), clicked)
    return places, picks[places.click]


def _flight(base: Base) -> FlightOfPhotos | None:
    telemetry = base.posed.telemetry
    if telemetry is None:
        return None
    return telemetry.prior, telemetry.track, telemetry.poses.frame_id


def _pairs(base: Base, places: Transferred, picks: Ints) -> list[Pair]:
    labels = base.inputs.picks.label
    return [(str(image), labels[i]) for image, i in zip(places.frame_id, picks, strict=True)]


def _looked(
    photos: Photos,
    base: Base,
    predicted: tuple[Transferred, Ints],
    rows: Ints,
    progress: Progress,
) -> dict[Pair, Found | Missed]:
    """What is found of some places.

    Parameters
    ----------
    photos, base, progress
        As of `searched`.
    predicted
        All places, and the number of the pick of each.
    rows
        Which of them to look at.
    """
    (places, picks), project = predicted, base.inputs.picks
    covariance = places.covariance_px2[rows] + LEAST_PX**2 * np.eye(2)
    sought = Sought(
        source_px=project.pixel_px[picks[rows]],
        target_px=places.pixel_px[rows],
        covariance_px2=covariance,
        affine=places.affine[rows],
    )
    target = [str(places.frame_id[row]) for row in rows]
    work = tasks([project.image[i] for i in picks[rows]], target, sought)
    found = look(photos, work, len(rows), progress)
    radius = radii(places.covariance_px2[rows])
    results: dict[Pair, Found | Missed] = {}
    for k, (image, pick) in enumerate(zip(target, picks[rows].tolist(), strict=True)):
        if found.refused[k]:
            why = reason(int(found.refused[k]))
            results[image, project.label[pick]] = Missed(pick, float(radius[k]), why)
        else:
            u, v = found.pixel_px[k].tolist()
            results[image, project.label[pick]] = Found(
                pick, (u, v), float(found.sigma_px[k]), float(found.score[k]), float(radius[k])
            )
    return results
