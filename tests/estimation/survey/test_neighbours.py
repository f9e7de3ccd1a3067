"""How well points are known against those next to them: what it hangs on, and what not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbours import (
    NEIGHBOUR_COUNT,
    estimate_variances,
    find_neighbours,
)
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine


def adjusted(survey: Survey) -> Adjustment:
    return refine(survey, SolveOptions())[0].adjustment


def uneven() -> Survey:
    """Rough ground, a point whose height is to be found, and one of which it was stated."""
    scene = make_scene(2, labels=9, roughness=0.05, heights={0: 1.4, 5: 0.8})
    return with_third_coordinates(scene, free=(0,), stated={5: 0.05}).survey


def distances(place: Floats) -> Floats:
    return np.asarray(np.linalg.norm(place[:, None] - place[None], axis=2))


def test_it_is_the_median_of_the_nearest_distances_sigmas() -> None:
    adjustment = adjusted(uneven())
    place, joint = adjustment.joint_points(np.arange(9))
    step = 1e-6
    by = np.stack(
        [
            (distances(place + step * one) - distances(place - step * one)) / (2 * step)
            for one in np.eye(27).reshape(27, 9, 3)
        ],
        axis=2,
    )
    sigma = np.sqrt(np.einsum("abi,ij,abj->ab", by, joint, by))

    found = find_neighbours(adjustment)
    for k in range(9):
        nearest = np.argsort(distances(place)[k])[1 : NEIGHBOUR_COUNT + 1]
        np.testing.assert_array_equal(found.row[k], nearest)
        np.testing.assert_allclose(found.distance_sigma_m[k], sigma[k, nearest], rtol=1e-5)
        assert found.sigma_m[k] == np.median(found.distance_sigma_m[k])


def test_a_far_point_that_one_photo_shows_changes_no_other_points_rating() -> None:
    survey = make_scene(2, spread=3.0).survey
    far = replace(
        survey,
        label=(*survey.label, "far"),
        height_above_m=np.append(survey.height_above_m, 0.0),
        height_sigma_m=np.zeros(0),
        is_free=np.zeros(0, np.bool_),
        identification_sigma_m=np.zeros(0),
        area=np.append(survey.area, 0),
        pick_frame=np.append(survey.pick_frame, 0),
        pick_label=np.append(survey.pick_label, len(survey.label)),
        pixel_px=np.vstack([survey.pixel_px, [1990.0, 10.0]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, survey.pick_sigma_px[0]),
    )
    before, after = adjusted(survey), adjusted(far)
    gauge = [np.sqrt(each.relative_points()[:12, 0, 0]) for each in (before, after)]

    assert np.max(gauge[1] / gauge[0]) > 1.2  # of the datum of all points
    np.testing.assert_allclose(
        find_neighbours(after).sigma_m[:12], find_neighbours(before).sigma_m, rtol=0.01
    )


def test_it_is_the_same_whichever_photo_is_the_origin() -> None:
    survey = make_scene(2, telemetry=False, gauge="plane").survey
    turned = replace(
        survey, frame_id=survey.frame_id[::-1], pick_frame=3 - survey.pick_frame, seeds=None
    )
    one, other = adjusted(survey), adjusted(turned)

    assert not np.allclose(one.points()[1], other.points()[1], rtol=0.1)
    np.testing.assert_allclose(
        find_neighbours(one).sigma_m, find_neighbours(other).sigma_m, rtol=1e-3
    )


def test_draws_tell_the_same_to_their_own_error() -> None:
    adjustment = adjusted(make_scene(2).survey)
    gradient, columns = adjustment.points_with_jacobian(np.arange(12))[1:]
    exact = adjustment.points()[1][:, 0, 0]
    minimum = adjustment.minimum
    drawn = estimate_variances(minimum.factor, minimum.blocks.values(), columns, gradient[:, 0])

    np.testing.assert_allclose(np.sqrt(drawn / exact), 1.0, atol=5 * 0.0625)


@pytest.mark.parametrize("labels", [2, 3])
def test_few_points_are_rated_by_those_there_are(labels: int) -> None:
    few = find_neighbours(adjusted(make_scene(1, labels=labels, control=2, lines=1).survey))

    assert few.row.shape == (labels, labels - 1)
    assert (few.sigma_m > 0).all()
