"""Tie points, matches and targets of a whole run, counted and projected anew."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_project import tie_picks, write_project
from hostile_surveys import make_survey
from scipy.spatial.transform import Rotation

from uavgram.geometry.camera.projection import project
from uavgram.geometry.ground.row_projection import row_poses
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.model.arrays import Floats
from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.model.survey import TiePicks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.summarise import tie_cloud

Run = tuple[Result, TieCloud, TiePicks]

SAME_PX = 1e-9


def by_the_row_seen(result: Result, frame: int, seen_px: Floats, world_m: Floats) -> Floats:
    """(n, 2) pixels of points (n, 3), each by the pose of the row in which it was seen."""
    poses = row_poses(result, frame)
    share = compute_row_share(seen_px[:, 1], result.camera.height_px)[:, None]
    turned = Rotation.from_rotvec(share * poses.sweep[3:]).as_matrix()
    away = world_m - poses.center - share * poses.sweep[:3]
    in_camera = np.einsum("nji,nj->ni", poses.rotation @ turned, away)
    return project(result.camera.model, result.shared.intrinsics.value, in_camera)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    survey = make_survey(Condition(ties=40, matched=True, photos=4, labels=10), 5)
    path = write_project(survey, tmp_path_factory.mktemp("tied"))
    ties = tie_picks(survey)
    inputs = read_inputs(path)
    picks, plates = inputs.picks, inputs.requests[0].points
    made: list[Source] = [picks.source_of(i) for i in range(len(picks.image))]
    made = [
        "target" if s == "hand" and n in plates else s
        for s, n in zip(made, picks.label, strict=True)
    ]
    inputs = replace(inputs, picks=replace(picks, source=tuple(made)), ties=ties)
    result, refined = compute(inputs, curved=False)
    cloud = tie_cloud(refined.adjustment, result.frames.frame_id)
    assert cloud is not None
    return result, cloud, ties


def test_each_photo_has_the_tie_points_of_the_table_that_another_one_shows(run: Run) -> None:
    result, cloud, ties = run
    often = Counter(ties.tie)
    seen = Counter(image for image, tie in zip(ties.image, ties.tie, strict=True) if often[tie] > 1)
    assert result.frames.ties.tolist() == [seen[name] for name in result.frames.frame_id]
    assert result.ties is not None
    assert result.ties.sightings == seen.total() == len(cloud.frame)
    assert result.ties.points == sum(count > 1 for count in often.values())
    assert len(cloud.position_world_m) == result.ties.points


def test_residuals_are_those_of_the_adjusted_points_in_the_adjusted_photos(run: Run) -> None:
    result, cloud, ties = run
    names = result.frames.frame_id
    at = {
        (image, *pixel): tie
        for image, tie, pixel in zip(ties.image, ties.tie, ties.pixel_px.tolist(), strict=True)
    }
    order = list(
        dict.fromkeys(
            at[names[f], *p]
            for f, p in zip(cloud.frame.tolist(), cloud.pixel_px.tolist(), strict=True)
        )
    )
    squares = []
    for frame, name in enumerate(names):
        own = cloud.pixel_px[cloud.frame == frame]
        point = [order.index(at[name, *pixel]) for pixel in own.tolist()]
        pixel = by_the_row_seen(result, frame, own, cloud.position_world_m[point])
        squares.append((pixel - own) ** 2)
        assert result.frames.ties_rms_px[frame] == pytest.approx(
            np.sqrt(squares[-1].mean()), abs=SAME_PX
        )
    together = np.sqrt(np.concatenate(squares).mean())
    assert result.ties is not None
    assert result.ties.rms_px == pytest.approx(together, abs=SAME_PX)


def test_a_point_has_the_photos_in_which_it_was_matched(run: Run) -> None:
    result, _, _ = run
    used = Counter(
        label
        for label, status in zip(result.picks.label, result.picks.status, strict=True)
        if status == "used"
    )
    assert "match" in result.picks.source
    frames = dict(zip(result.points.label, result.points.frames, strict=True))
    assert {label: len(names) for label, names in frames.items()} == used
    assert all(len(set(names)) == len(names) for names in frames.values())


def test_each_source_has_its_noise(run: Run) -> None:
    result, _, _ = run
    assert result.noise is not None
    assert [one.source for one in result.noise.picks] == ["hand", "target", "match", "tie"]


def test_a_value_that_no_person_picked_is_told_by_name(run: Run) -> None:
    result, _, _ = run
    (told,) = (one for one in result.messages if one.code == "only-program-picks")
    rows = result.measurements
    plates = set(rows.points[0])
    alone = tuple(n for n, ends in zip(rows.name, rows.points, strict=True) if set(ends) <= plates)
    assert told.measurements == alone
    assert len(alone) < len(rows.name)
