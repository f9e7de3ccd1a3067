"""Methods of finding the pose of one photo, compared: right ones are honest, limits show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from scipy.stats import chi2

from uavgram.estimation.first_poses.photo_problem import PhotoProblem, Photos, SharedErrors, State
from uavgram.estimation.repeated.single_photo import adjust_photos
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.observed import Observations
from uavgram.model.observations import NO_KNOWN, KnownLines, KnownWorldPoints, Picks
from uavgram.model.options import GroundOptions, SolveOptions
from uavgram.model.simulation import MethodRow
from uavgram.pipeline.measure.compute import adjust_survey
from uavgram.stages.assemble import assemble
from uavgram.synthetic import pose_methods
from uavgram.synthetic.pose_methods import (
    LINES,
    METHODS,
    compare_methods,
    find_minima,
    find_point_starts,
)
from uavgram.synthetic.single_photos import MethodScenes, Setting, draw_scenes

SCENES = 40


@pytest.fixture(scope="module")
def usual() -> dict[str, MethodRow]:
    return {
        row.method: row
        for row in compare_methods(Setting(name="usual", features=(6, 7)), SCENES, 2)
    }


def test_every_method_has_its_row(usual: dict[str, MethodRow]) -> None:
    assert tuple(usual) == tuple(METHODS)
    assert {row.scenes for row in usual.values()} == {SCENES}


@pytest.mark.parametrize("method", ["lines of known position", "lengths and log", "log", "all"])
def test_sigmas_are_honest(usual: dict[str, MethodRow], method: str) -> None:
    """Twelve distances of a scene hang together: as if each scene were three numbers."""
    row = usual[method]
    spread = 1.0 / np.sqrt(2 * 3 * SCENES)

    assert abs(row.z - 1.0) < 4 * spread
    assert row.coverage > 0.95 - 4 * np.sqrt(0.95 * 0.05 / (3 * SCENES))


def test_what_knows_more_is_better(usual: dict[str, MethodRow]) -> None:
    error = {name: row.rms_m for name, row in usual.items()}

    assert error["all"] < min(error["points"], error["lengths and log"]) < error["log"]
    assert error["points"] <= error["points, IPPE alone"]
    # A log alone is no use here, and its sigmas say so.
    assert usual["log"].failed > 0.2
    assert usual["log"].failed_silently == 0.0


def test_distortion_left_out_breaks_the_sigmas_of_all_but_the_log() -> None:
    setting = Setting(name="distorted", features=(7, 7), bulge=-0.1)
    rows = {row.method: row for row in compare_methods(setting, 20, 3)}

    assert all(rows[name].z > 1.5 for name in ("points", "lines of known position", "lengths"))


def test_scenes_are_drawn_again_from_their_seed_alone() -> None:
    first, again, other = (draw_scenes(Setting(name="a"), 5, 3, seed) for seed in (1, 1, 2))

    np.testing.assert_array_equal(first.pixel_px, again.pixel_px)
    assert np.abs(first.place_m - other.place_m).max() > 0.1
    # Withheld distances are true ones of places that the photo shows.
    assert (first.check_m >= 3.0).all()
    assert ((first.pixel_px > -5) & (first.pixel_px < 4005)).all()


def test_a_setting_without_room_is_refused() -> None:
    long = replace(Setting(name="too long"), length_m=(60.0, 70.0))
    with pytest.raises(ValueError, match="a photo shows 0 of the 4 lines"):
        draw_scenes(long, 4, 1, 0)


def test_who_gives_no_pose_says_so() -> None:
    """IPPE takes four points: of three lines there is none, and no silent failure."""
    rows = {
        row.method: row for row in compare_methods(Setting(name="three", features=(3, 3)), 4, 1)
    }

    for name in ("points", "points, IPPE alone"):
        assert rows[name].failed == 1.0
        assert rows[name].failed_silently == 0.0


# Pose by points, lines, lengths and a log: honest sigmas, right slopes, the survey's own way.


USES = {
    "points": frozenset({"start"}),
    "lines": LINES,
    "lengths": frozenset({"length", "log"}),
    "all": frozenset({"start", "end on line", "length", "log"}),
}
DEGREES = {"points": 2 * 6 - 6, "lines": 2 * 6 - 6, "lengths": 6, "all": 4 * 6}
"""Degrees of freedom of a scene with six lines."""


@pytest.fixture(scope="module")
def scenes() -> MethodScenes:
    return draw_scenes(Setting(name="usual"), 6, 150, 5)


def problem_of(
    scenes: MethodScenes, name: str, monkeypatch: pytest.MonkeyPatch
) -> tuple[PhotoProblem, State]:
    """The photos as they are adjusted, and a state off the truth."""
    asked: list[PhotoProblem] = []

    def listened(shared: SharedErrors, photos: Photos, *rest: object, **more: object) -> object:
        asked.append(PhotoProblem(shared, photos))
        return adjust_photos(shared, photos, *rest, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(pose_methods, "adjust_photos", listened)
    find_minima(scenes, USES[name], (scenes.center[:, None], scenes.rotation[:, None]))
    problem, count = asked[0], len(scenes.center)
    place = scenes.place_m.reshape(count, -1, 2)
    center = problem.photos.center + 0.1
    return problem, State(center, np.full((count, 3), 0.01), place + 0.05, np.zeros((count, 0)))


@pytest.mark.parametrize("name", USES)
def test_the_reduced_slope_is_that_of_the_sum_of_squares(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where errors and places are the best ones for their pose, as after a step of no length."""
    few = draw_scenes(Setting(name="usual"), 4, 2, 9)
    problem, state = problem_of(few, name, monkeypatch)
    both, still = np.arange(2), np.zeros((2, 6))
    for _ in range(30):  # the best places for that pose
        state = State(*problem.move(state, problem.linearise(both, state), still))
    line = problem.linearise(both, state)

    def half_cost(step: np.ndarray) -> np.ndarray:
        steps = np.repeat(step[None], 2, axis=0)
        return 0.5 * problem.linearise(both, problem.move(state, line, steps)).cost

    numeric = central_differences(half_cost, np.zeros(6), 1e-5)
    assert_derivative(line.gradient[:, None], numeric[:, None], 1e-4)


@pytest.mark.parametrize("name", USES)
def test_sums_of_squares_and_poses_are_as_stated(scenes: MethodScenes, name: str) -> None:
    starts = scenes.center[:, None], scenes.rotation[:, None]
    found = find_minima(scenes, USES[name], starts)
    count = len(scenes.center)

    assert np.isfinite(found.covariance).all()
    free = count * DEGREES[name]
    assert chi2.ppf(5e-4, free) <= float(found.cost.sum()) <= chi2.ppf(1 - 5e-4, free)
    off = (found.center[:, 0] - scenes.center)[:, :, None]
    covariance = found.covariance[:, 0, :3, :3]
    squares = float(np.sum(off.swapaxes(1, 2) @ np.linalg.solve(covariance, off)))
    assert chi2.ppf(5e-4, 3 * count) <= squares <= chi2.ppf(1 - 5e-4, 3 * count)


def surveyed(scenes: MethodScenes, k: int) -> Refined:
    """One scene the survey's own way: starts as control points, lengths taped."""
    lines = scenes.pixel_px.shape[1]
    names = [f"{end}{i}" for i in range(lines) for end in "ab"]
    count = len(names)
    place = np.column_stack([scenes.place_m[k, :, 0], np.zeros(lines)])
    sigma = np.column_stack([np.full((lines, 2), scenes.place_sigma_m), np.full(lines, 1e3)])
    observed = Observations(
        calibration=scenes.calibration,
        picks=Picks(
            image=("photo",) * count,
            label=tuple(names),
            pixel_px=scenes.pixel_px[k].reshape(-1, 2),
            sigma_px=np.full(count, scenes.pick_sigma_px),
            height_m=np.full(count, np.nan),
        ),
        lines=KnownLines(
            name=tuple(f"l{i}" for i in range(lines)),
            start=tuple(names[::2]),
            end=tuple(names[1::2]),
            length_m=scenes.length_m[k],
            sigma_m=np.full(lines, scenes.length_sigma_m),
            adjust=np.ones(lines, dtype=np.bool_),
        ),
        known=NO_KNOWN,
        control=KnownWorldPoints(label=tuple(names[::2]), world_m=place, sigma_m=sigma),
        ground=GroundOptions(height_sigma_m=1e-6, slope_sigma_deg=1e-6, roughness_sigma_m=0.0),
        picks_sigma_px=1.0,
        photos=("photo",),
    )
    observed = replace(observed, tape=replace(observed.tape, scale_sigma=0.0))
    survey = assemble(observed).survey
    refined, _ = adjust_survey(survey, SolveOptions(noise="stated"))
    return refined


def test_it_is_the_surveys_own_pose(scenes: MethodScenes) -> None:
    """To 1e-3 of a sigma, the survey's ground being known to a micrometre."""
    found = find_minima(scenes, frozenset({"start", "length"}), find_point_starts(scenes))
    for k in range(3):
        state = surveyed(scenes, k).adjustment.state
        sigma = np.sqrt(np.diag(found.covariance[k, 0]))
        assert np.abs((state.center[0] - found.center[k, 0]) / sigma[:3]).max() < 1e-3


def test_a_start_below_the_ground_is_no_pose(scenes: MethodScenes) -> None:
    below = scenes.center[:, None] * [1, 1, -1]
    found = find_minima(scenes, frozenset({"start"}), (below, scenes.rotation[:, None]))

    assert np.isinf(found.cost).all()
