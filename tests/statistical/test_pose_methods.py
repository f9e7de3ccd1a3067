"""One frame's pose from known points and from lengths, on the same picks: how good, when neither.

Points and tapes are both good to 1 cm, picks to 0.7 px, from 24 to 30 m. Judged is a distance
between two points that neither method knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
import scenes
from scenes import Scene, make_scene
from scipy.stats import chi2

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.known_points import find_known_point_poses
from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.geometry.ground import measurements
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

SIGMA_M = 0.01
TAIL = 1e-5 / 2
FAN = ((0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (3, 4), (5, 0))
TRIANGLE = ((0, 1), (1, 2), (2, 0))
METHODS = ("points", "lengths")
ENDS = (6, 7)
LEARNT, AS_STATED = SolveOptions(), SolveOptions(noise="stated")


class Outcome(NamedTuple):
    """Of one frame: relative error and squared error over variance of the distance; rivals; fit.

    And whether the run reports that something does not fit: the whole, or known points.
    """

    error: float
    squared: float
    rivals: int
    fit: float
    misfits: bool


@pytest.fixture(autouse=True)
def _equal_sigmas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "CONTROL_SIGMA", np.full(3, SIGMA_M))


def by_points(survey: Survey) -> Survey:
    """Without its lengths, from the poses that OpenCV gives."""
    nothing = np.empty(0, dtype=int)
    survey = replace(
        survey,
        line_start=nothing,
        line_end=nothing,
        length_m=np.empty(0),
        length_sigma_m=np.empty(0),
    )
    return replace(survey, candidate_poses=find_known_point_poses(survey))


def by_lengths(survey: Survey) -> Survey:
    """Without its coordinates."""
    return replace(
        survey,
        control_label=np.empty(0, dtype=int),
        control_world_m=np.empty((0, 3)),
        control_sigma_m=np.empty((0, 3)),
        gauge="plane",
    )


def outcome(scene: Scene, survey: Survey, solve: SolveOptions) -> Outcome | None:
    """None where the method says that it has no pose."""
    try:
        refined, messages = refine(survey, solve)
    except GeometryError:
        return None
    adjustment = refined.adjustment
    label = np.array([adjustment.label_index(f"P{k}") for k in ENDS])
    world, covariance = adjustment.joint_points(label)
    value, gradient = measurements.distance(world)
    true = float(np.linalg.norm(scene.world[ENDS[1]] - scene.world[ENDS[0]]))
    blocks = adjustment.minimum.blocks.values()
    degrees = sum(b.residual.size for b in blocks) - adjustment.problem.layout.size
    fit = compute_upper_tail(adjustment.minimum.cost, degrees)
    return Outcome(
        error=(value - true) / true,
        squared=float((value - true) ** 2 / (gradient.ravel() @ covariance @ gradient.ravel())),
        rivals=len(refined.alternatives),
        fit=fit,
        misfits=fit < 0.001 or any(one.code == "control-left-out" for one in messages),
    )


def outcomes(
    count: int,
    change: Callable[[Survey], Survey] = lambda survey: survey,
    solve: SolveOptions = LEARNT,
    **options: Any,  # noqa: ANN401 - of `make_scene`
) -> dict[str, list[Outcome | None]]:
    """Of both methods on the same scenes in which all eight points are seen."""
    options = {"control": 6, "ends": FAN, **options}
    found: dict[str, list[Outcome | None]] = {name: [] for name in METHODS}
    seed = 300
    while len(found["points"]) < count:
        scene = make_scene(seed, frames=1, labels=8, telemetry=False, **options)
        seed += 1
        if len(scene.survey.pick_frame) < 8:
            continue
        survey = change(scene.survey)
        found["points"].append(outcome(scene, by_points(survey), solve))
        found["lengths"].append(outcome(scene, by_lengths(survey), solve))
    return found


def posed(results: Sequence[Outcome | None]) -> list[Outcome]:
    """All of them: none may lack its pose."""
    there = [one for one in results if one is not None]
    assert len(there) == len(results)
    return there


def rms(results: Sequence[Outcome | None]) -> float:
    return float(np.sqrt(np.mean([one.error**2 for one in posed(results)])))


def within_bounds(results: Sequence[Outcome | None]) -> bool:
    squares = [one.squared for one in posed(results)]
    low, high = chi2.ppf(np.array([TAIL, 1 - TAIL]), len(squares)) / len(squares)
    return bool(low <= np.mean(squares) <= high)


def test_over_a_wide_scene_both_are_equally_good_honest_and_unambiguous() -> None:
    found = outcomes(24)
    for name in METHODS:
        assert None not in found[name], name
        assert rms(found[name]) < 0.006, name  # of the distance
        assert within_bounds(found[name]), name
        assert sum(one.rivals > 0 for one in posed(found[name])) == 0, name
    assert 0.5 < rms(found["points"]) / rms(found["lengths"]) < 2.0


def test_a_small_scene_from_far_leaves_both_with_a_rival_pose() -> None:
    # Two metres from 27 m: hardly any perspective, so a plane may lean either way.
    found = outcomes(12, spread=1.0)
    for name in METHODS:
        assert sum(one.rivals > 0 for one in posed(found[name])) >= 8, name
        assert rms(found[name]) > 0.01, name


def test_three_points_and_three_lengths_are_ambiguous() -> None:
    found = outcomes(8, control=3, ends=TRIANGLE)
    for name in METHODS:
        rivals = [one is None or one.rivals > 0 for one in found[name]]
        assert sum(rivals) >= 7, name  # the three-point problem: up to four poses


def test_wrong_sigmas_of_coordinates_show_in_the_fit_and_spoil_the_points_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Coordinates that are five times worse than stated.
    monkeypatch.setattr(scenes, "CONTROL_SIGMA", np.full(3, 5 * SIGMA_M))

    def stated(survey: Survey) -> Survey:
        return replace(survey, control_sigma_m=survey.control_sigma_m / 5)

    # At the stated noise: what the picks do not fit would be learnt as theirs, and told so.
    found = outcomes(16, stated, AS_STATED)
    assert not within_bounds(found["points"])
    assert sum(one.misfits for one in posed(found["points"])) >= 14  # and the run reports it
    assert within_bounds(found["lengths"])
    assert sum(one.misfits for one in posed(found["lengths"])) <= 1


def test_a_datum_that_is_off_moves_the_points_but_no_distance() -> None:
    def shifted(survey: Survey) -> Survey:
        return replace(survey, control_world_m=survey.control_world_m + np.array([3.0, -2.0, 0.0]))

    plain = outcomes(4)["points"]
    moved = outcomes(4, shifted)["points"]
    np.testing.assert_allclose(
        [one.error for one in posed(moved)], [one.error for one in posed(plain)], atol=1e-5
    )
