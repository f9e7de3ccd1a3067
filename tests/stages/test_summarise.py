"""The tables of a result: units, places, states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_project import tie_picks, write_project
from hostile_surveys import make_survey
from scenes import Scene
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.camera.projection import project
from uavgram.geometry.ground.row_projection import row_poses
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.observations import Source
from uavgram.model.options import SolveOptions
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.model.survey import TiePicks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.judge import judge_groups
from uavgram.stages.refine import refine
from uavgram.stages.summarise import (
    DECIMALS,
    summarise_areas,
    summarise_frames,
    summarise_orientation,
    summarise_shared,
    summarise_solution,
    tie_cloud,
)


@pytest.fixture(scope="module")
def scene(scene_factory: Callable[..., Scene]) -> Scene:
    return scene_factory(2, frames=5)


@pytest.fixture(scope="module")
def refined(scene: Scene) -> Refined:
    return refine(scene.survey, SolveOptions())[0]


def test_shared_unknowns_stand_in_degrees_with_their_own_sigmas(refined: Refined) -> None:
    adjustment = refined.adjustment
    shared = summarise_shared(adjustment, 3.0)
    layout, state = adjustment.problem.layout, adjustment.state
    joint = adjustment.minimum.factor.joint(np.arange(layout.size))
    sigma = np.sqrt(np.diag(joint))
    first = layout.first_telemetry
    expected = {
        "boresight_deg": (slice(0, 3), 180 / np.pi, 0.0),
        "lever_arm_m": (slice(3, 6), 1.0, 0.0),
        "position_bias_m": (slice(6, 9), 1.0, 0.0),
        "heading_bias_deg": (slice(9, 10), 180 / np.pi, 0.0),
        "clock_offset_s": (slice(10, 11), 1.0, 3.0),
        "clock_drift_ppm": (slice(11, 12), 1e6, 0.0),
    }
    for name, (part, unit, shift) in expected.items():
        estimate = getattr(shared, name)
        np.testing.assert_allclose(estimate.value, state.telemetry[part] * unit + shift)
        np.testing.assert_allclose(estimate.sigma, sigma[first:][part] * unit)
    (ground,) = summarise_areas(adjustment)
    np.testing.assert_allclose(ground.height_m.value, state.plane[:1])
    np.testing.assert_allclose(ground.slope_deg.value, np.degrees(state.plane[1:]), rtol=1e-3)
    plane = sigma[layout.first_plane :][:3]
    np.testing.assert_allclose(ground.slope_deg.sigma, np.degrees(plane[1:]), rtol=1e-3)
    basis = adjustment.problem.intrinsic_basis
    part = slice(layout.first_intrinsic, layout.first_plane)
    covariance = basis @ joint[part, part] @ basis.T
    np.testing.assert_allclose(shared.intrinsics.sigma, np.sqrt(np.diag(covariance)))
    prior = adjustment.survey.calibration.covariance
    assert (shared.intrinsics.sigma <= np.sqrt(np.diag(prior)) * (1 + 1e-9)).all()


def test_shared_unknowns_recover_the_truth_within_their_sigmas(
    scene: Scene, refined: Refined
) -> None:
    shared = summarise_shared(refined.adjustment, 0.0)
    truth = scene.truth.telemetry
    for name, part in (("lever_arm_m", slice(3, 6)), ("position_bias_m", slice(6, 9))):
        estimate = getattr(shared, name)
        assert (np.abs(estimate.value - truth[part]) < 4.5 * estimate.sigma).all()
    assert shared.clock_offset_s is not None
    assert abs(shared.clock_offset_s.value[0] - truth[10]) < 4.5 * shared.clock_offset_s.sigma[0]


@pytest.mark.parametrize("gauge", ["world", "plane"])
def test_every_area_has_its_own_plane_the_gauges_without_error(
    scene_factory: Callable[..., Scene], gauge: str
) -> None:
    log = gauge == "world"
    scene = scene_factory(
        4, frames=3, lines=9, verge=(0, 3, 5, 7), telemetry=log, gauge=gauge, noise=0.0
    )
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    road, verge = summarise_areas(adjustment)
    assert (road.name, verge.name) == ("default", "verge")
    np.testing.assert_allclose(road.height_m.value, [0.0], atol=1e-6)
    np.testing.assert_allclose(verge.height_m.value, [0.4], atol=1e-6)
    np.testing.assert_allclose(verge.slope_deg.value, [0.0, 0.0], atol=1e-5)
    assert (road.height_m.sigma > 0) == log
    assert 0 < verge.height_m.sigma < 0.3
    columns = adjustment.problem.plane_columns(np.array([0]))  # a label of the verge
    sigma = np.sqrt(np.diag(adjustment.minimum.factor.joint(columns[0])))
    np.testing.assert_allclose(verge.height_m.sigma, sigma[:1])
    np.testing.assert_allclose(verge.slope_deg.sigma, np.degrees(sigma[1:]), rtol=1e-3)


def test_without_log_there_are_no_biases_and_the_plane_is_exact(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2, telemetry=False, gauge="plane")
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    shared, (ground,) = summarise_shared(adjustment, 0.0), summarise_areas(adjustment)
    assert shared.boresight_deg is None
    assert shared.clock_offset_s is None
    assert shared.clock_drift_ppm is None
    assert ground.height_m.value == [0.0]
    assert (ground.slope_deg.sigma == 0).all()


def test_every_frame_has_a_state_and_a_reason(scene: Scene, refined: Refined) -> None:
    survey = scene.survey
    names = ("extra", "f3", "f0", "f1", "f2", "f4", "unpicked", "left out")
    matched = np.array([False] + 7 * [True])
    frames = Frames(
        frame_id=names,
        time_utc_s=np.where(matched, 50.0, np.nan),
        sigma_time_s=np.where(matched, 0.1, np.nan),
        matched=matched,
        reason=("outside the log", *[""] * 7),
        clock_offset_s=0.0,
        clock_offset_sigma_s=1.0,
    )
    seeds = survey.seeds
    assert seeds is not None
    assert survey.telemetry is not None
    more = replace(
        seeds,
        frame_id=(*seeds.frame_id, "unpicked", "left out"),
        center_world_m=np.vstack([seeds.center_world_m, np.ones((2, 3))]),
        world_from_camera=np.concatenate([seeds.world_from_camera, np.tile(np.eye(3), (2, 1, 1))]),
        covariance=np.concatenate([seeds.covariance, np.tile(np.eye(6), (2, 1, 1))]),
    )
    picked = dict.fromkeys(survey.frame_id, "") | {"left out": "looks at the sky", "extra": ""}
    table = summarise_frames(frames, names, "/photos", more, refined, picked)
    assert table.status == ("unmatched", *["refined"] * 5, "seeded", "rejected")
    assert table.reason[0] == "outside the log"
    assert table.reason[-1] == "looks at the sky"
    state = refined.adjustment.state
    np.testing.assert_array_equal(table.refined.center_world_m[2], state.center[0])
    np.testing.assert_array_equal(table.refined.center_world_m[1], state.center[3])
    np.testing.assert_array_equal(table.seed.center_world_m[2], seeds.center_world_m[0])
    assert np.isnan(table.refined.center_world_m[[0, 6, 7]]).all()
    assert np.isnan(table.seed.center_world_m[0]).all()
    # A camera clock that is late by the correction: exposures were earlier.
    clock, drift = state.telemetry[10:]
    middle = survey.telemetry.middle_s
    np.testing.assert_allclose(table.time_utc_s[1], 50.0 - clock - drift * (50.0 - middle))


def test_the_summary_counts_what_was_observed(refined: Refined) -> None:
    groups, _ = judge_groups(refined.adjustment, 0.001)
    summary = summarise_solution(refined, groups, ())
    blocks = refined.adjustment.minimum.blocks
    observations = sum(b.residual.size for b in blocks.values())
    assert summary.degrees_of_freedom == observations - refined.adjustment.problem.layout.size
    assert summary.variance_factor * summary.degrees_of_freedom == pytest.approx(
        refined.adjustment.minimum.cost
    )
    assert summary.chi2_probability == pytest.approx(
        chi2.sf(refined.adjustment.minimum.cost, summary.degrees_of_freedom)
    )
    assert summary.converged


def test_an_alternative_carries_its_height_tilt_and_values(
    scene_factory: Callable[..., Scene],
) -> None:
    ends = ((0, 1), (1, 2), (2, 0))
    for seed in range(8):
        scene = scene_factory(
            seed, frames=1, labels=6, ends=ends, noise=0.0, telemetry=False, gauge="plane"
        )
        refined = refine(scene.survey, SolveOptions())[0]
        if refined.alternatives:
            break
    values = tuple((float(k),) for k in range(len(refined.alternatives)))
    summary = summarise_solution(refined, (), values)
    for found, other, value in zip(summary.alternatives, refined.alternatives, values, strict=True):
        axis = other.state.rotation[0] @ [0, 0, 1]
        assert found.tilt_deg == pytest.approx(np.degrees(np.arccos(-axis[2])))
        assert found.height_m == other.state.center[0, 2]
        assert found.frame_id == "f0"
        assert found.values == value


# Correlations of the poses with camera and ground plane.


def test_they_are_those_of_the_dense_joint_covariance(scene_factory: Callable[..., Scene]) -> None:
    adjustment = refine(scene_factory(2, frames=5).survey, SolveOptions())[0].adjustment
    told = summarise_orientation(adjustment)
    layout, basis = adjustment.problem.layout, adjustment.problem.intrinsic_basis
    joint = adjustment.minimum.factor.joint(np.arange(layout.size))
    lens = np.arange(layout.first_intrinsic, layout.first_intrinsic + layout.intrinsics)
    plane = np.arange(layout.first_plane, layout.first_plane + 3)
    for frame in range(layout.frames):
        pose = layout.frame_columns(np.array([frame]))[0]
        columns = np.concatenate([pose, lens, plane])
        to_lens = np.zeros((9 + len(basis), len(columns)))
        to_lens[:6, :6] = np.eye(6)
        to_lens[6:-3, 6:-3] = basis
        to_lens[-3:, -3:] = np.eye(3)
        covariance = to_lens @ joint[np.ix_(columns, columns)] @ to_lens.T
        sigma = np.sqrt(np.diag(covariance))
        wanted = covariance / np.outer(sigma, sigma)

        bound = 0.51 * 10.0**-DECIMALS
        np.testing.assert_allclose(told.with_pose[frame], wanted[:6, 6:], atol=bound)
        np.testing.assert_allclose(told.shared, wanted[6:, 6:], atol=bound)

    assert told.frame_id == adjustment.survey.frame_id
    assert told.parameters[-3:] == ("plane height", "slope east", "slope north")
    assert len(told.parameters) == len(basis) + 3


# Tie points, matches and targets of a whole run, counted and projected anew.


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
    made: list[Source] = list(picks.source)
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
