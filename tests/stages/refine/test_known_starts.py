"""Surveys without a log, placed by lengths together with right angles, parallels and the like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lanes import Lane, lane, measured, true_distance
from scenes import make_scene

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.ground import measurements
from uavgram.model.observations import KnownThing
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

STATED = SolveOptions(noise="stated")
LENGTH, OTHER_LENGTH = ("length", (0, 1)), ("length", (1, 2))
CORNERS = tuple(("right_angle", c) for c in ((0, 1, 2), (1, 2, 3), (2, 3, 0)))
LONG, SHORT = ("parallel", (0, 1, 3, 2)), ("parallel", (1, 2, 0, 3))
WIDTH = ("line_distance", (2, 0, 1))


def codes(scene: Lane) -> tuple[Refined, set[str]]:
    refined, messages = refine(scene.survey, STATED)
    return refined, {message.code for message in messages}


@pytest.mark.parametrize(
    "things",
    [
        (LENGTH, *CORNERS[:2]),
        (LENGTH, LONG, SHORT),
        (WIDTH, LONG, CORNERS[0]),
        (LENGTH, OTHER_LENGTH, CORNERS[0], LONG),
    ],
    ids=["two right angles", "two parallels", "a lane's width", "a rectangle"],
)
def test_exact_data_give_true_distances(things: tuple[tuple[str, tuple[int, ...]], ...]) -> None:
    for seed in (2, 3):
        scene = lane(seed).known(*things)
        refined, _ = codes(scene)
        found = [measured(one)[0] for one in (refined.adjustment, *refined.alternatives)]
        assert min(abs(np.array(found) - true_distance(scene))) < 1e-3


def test_distances_from_a_length_and_two_parallels_are_as_uncertain_as_stated() -> None:
    z = []
    for seed in range(20):
        scene = lane(seed, noise=1.0).known(LENGTH, CORNERS[0], LONG, noise=1.0)
        try:
            value, sigma = measured(codes(scene)[0].adjustment)
        except GeometryError:
            continue
        if sigma < 0.05 * value:  # where it is known, and first order holds
            z.append((value - true_distance(scene)) / sigma)
    assert len(z) >= 12
    # Root mean square of n normal values: 1 +- 3 / sqrt(2 n), here for 12.
    assert 0.38 < np.sqrt(np.mean(np.square(z))) < 1.62
    assert np.abs(z).max() < 3.9


def test_one_length_and_one_right_angle_are_one_thing_short() -> None:
    with pytest.raises(GeometryError, match="1 length and 1 right angle: one more is missing"):
        codes(lane(2).known(LENGTH, CORNERS[0]))


def test_what_is_missing_is_named() -> None:
    with pytest.raises(GeometryError, match=r"3 right angles: none fixes the scale"):
        codes(lane(2).known(*CORNERS))
    with pytest.raises(GeometryError, match=r"'f0' shows 1 distance from a line: two more are"):
        codes(lane(2).known(WIDTH))
    with pytest.raises(
        GeometryError, match=r"1 length and 3 pairs of parallel .* do not fix the camera"
    ):
        codes(lane(2, noise=1.0).known(LENGTH, LONG, LONG, ("parallel", (3, 2, 0, 1))))


def test_photos_that_see_less_join_the_one_that_is_placed_by_known_things() -> None:
    scene = make_scene(
        5, frames=4, labels=12, ends=((0, 1),), telemetry=False, gauge="plane", noise=0.0
    )
    corners = ((0, 1, 2), (3, 4, 5), (6, 7, 8), (1, 5, 9))
    known = tuple(
        KnownThing(
            index=k,
            name=f"angle {k}",
            kind="angle",
            label=corner,
            value=float(np.degrees(measurements.angle(scene.world[list(corner)])[0])),
            sigma=0.2,
        )
        for k, corner in enumerate(corners)
    )
    adjustment = refine(replace(scene.survey, known=known), STATED)[0].adjustment
    assert adjustment.survey.frame_id == scene.survey.frame_id
    np.testing.assert_allclose(adjustment.state.center[:, 2], scene.truth.center[:, 2], atol=1e-3)


def test_the_right_angle_that_is_none_takes_no_part() -> None:
    for seed in (2, 3):
        right = lane(seed, noise=1.0).known(LENGTH, *CORNERS, LONG, noise=1.0)
        wrong = right.known(LENGTH, *CORNERS, LONG, ("right_angle", (0, 1, 4)), noise=0.0)
        survey = replace(right.survey, known=wrong.survey.known)
        refined, _ = refine(survey, STATED)
        assert refined.known_removed == {4}
        assert [(removal.kind, removal.index) for removal in refined.removals] == [("known", 4)]
        value, sigma = measured(refined.adjustment)
        assert abs(value - true_distance(right)) < 3.3 * sigma


def test_collinear_points_and_level_ones_place_no_photo() -> None:
    scene = lane(2).known(LENGTH, ("collinear", (0, 4, 1)), ("level", (0, 1, 2)))
    with pytest.raises(GeometryError, match=r"three known lengths .*most so far: 1 in 'f0'"):
        codes(scene)


def test_three_things_alone_are_said_to_be_unchecked() -> None:
    assert "three-known" in codes(lane(3).known(LENGTH, LONG, SHORT))[1]
    assert "three-known" not in codes(lane(3).known(LENGTH, LONG, SHORT, CORNERS[0]))[1]


def test_known_things_of_other_photos_points_are_not_taken_for_this_ones() -> None:
    scene = lane(3).known(LENGTH, LONG, SHORT)
    survey = scene.survey
    without = np.flatnonzero(survey.pick_label != 3)
    names = ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
    unseen = replace(survey, **{name: getattr(survey, name)[without] for name in names})
    with pytest.raises(GeometryError, match="three known lengths"):
        refine(unseen, STATED)


def test_points_whose_height_is_to_be_found_place_no_photo() -> None:
    scene = lane(3).known(LENGTH, LONG, SHORT)
    free = replace(scene.survey, is_free=np.arange(6) == 2)
    with pytest.raises(GeometryError, match="three known lengths"):
        refine(free, STATED)
