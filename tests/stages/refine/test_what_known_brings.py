"""What a survey gains by what is known: smaller sigmas that hold the truth, and points placed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

STATED = SolveOptions(noise="stated")


def known(kind: str, *label: int, sigma: float, value: float = np.nan) -> KnownThing:
    return KnownThing(index=0, name=kind, kind=kind, label=label, value=value, sigma=sigma)


def solve(scene: Scene, *things: KnownThing) -> Refined:
    numbered = tuple(replace(thing, index=i) for i, thing in enumerate(things))
    return refine(replace(scene.survey, known=numbered), STATED)[0]


def slope_sigma(refined: Refined) -> float:
    """Of the ground towards the east."""
    layout = refined.adjustment.problem.layout
    return float(np.sqrt(refined.adjustment.shared_covariance(layout.first_plane + 1, 1)[0, 0]))


def test_a_level_line_tells_how_the_ground_slopes() -> None:
    scene = make_scene(4, frames=2, lines=4, telemetry=True)
    east = scene.world[:, 0]
    ends = int(east.argmin()), int(east.argmax())
    apart = float(np.ptp(east))
    # As a hose level shows it.
    rise = float(scene.world[ends[1], 2] - scene.world[ends[0], 2])
    line = known("vertical_distance", *ends, value=rise, sigma=0.01)
    before, after = solve(scene), solve(scene, line)

    assert slope_sigma(after) < 0.6 * slope_sigma(before)
    assert slope_sigma(after) < 3 * 0.01 / apart


def test_a_roof_corner_that_one_photo_shows_is_placed_by_the_foot_of_its_wall() -> None:
    scene = make_scene(4, frames=1, heights={0: 2.4}, ends=((1, 2), (3, 4), (5, 6), (7, 8)))
    survey = scene.survey
    free = np.isin(np.arange(len(survey.label)), [0])
    world = scene.world.copy()
    foot = int(np.argmin(np.linalg.norm(world[1:, :2] - world[0, :2], axis=1))) + 1
    offset = world[0, :2] - world[foot, :2]
    alone = replace(
        scene, survey=replace(survey, is_free=free, height_above_m=0.0 * survey.height_above_m)
    )
    away = known("horizontal_distance", foot, 0, value=float(np.linalg.norm(offset)), sigma=0.01)

    assert "P0" not in solve(alone).adjustment.survey.label
    refined = solve(alone, away)
    at = refined.adjustment.label_index("P0")
    points, covariance = refined.adjustment.points()
    error = points[at] - world[0]
    assert np.sqrt(covariance[at, 2, 2]) < 1.0
    assert abs(error[2]) < 4 * np.sqrt(covariance[at, 2, 2])


def test_angles_sharpen_a_survey_without_a_log() -> None:
    pairs = tuple((k, k + 6) for k in range(4))
    scene = make_scene(8, frames=1, lines=4, ends=pairs, telemetry=False, gauge="plane")
    legs = ((4, 5, 6), (0, 1, 2))
    angles = [known("angle", *leg, value=angle_at(scene.world, leg), sigma=0.1) for leg in legs]

    assert spread(solve(scene, *angles)) < 0.9 * spread(solve(scene))


def angle_at(world: Floats, leg: tuple[int, int, int]) -> float:
    a, b, c = world[list(leg)]
    u, v = a - b, c - b
    return float(np.degrees(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))))


def spread(refined: Refined) -> float:
    """Root mean square of the sigmas of all points [m]."""
    _, covariance = refined.adjustment.points()
    return float(np.sqrt(np.mean(np.einsum("nii->ni", covariance)[:, :2])))
