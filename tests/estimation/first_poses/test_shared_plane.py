"""Planes under photos by the points that two of them share: OpenCV's decomposition as the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from scenes import INTRINSICS, Scene, cv_pixels

from uavgram.estimation.first_poses.shared_plane import find_shared_planes
from uavgram.estimation.survey.selection import select_lines
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

FEW_LENGTHS: dict[str, Any] = {
    "frames": 4,
    "labels": 12,
    "lines": 4,
    "spread": 8.0,
    "tilt": 0.35,
    "telemetry": False,
    "gauge": "plane",
    "noise": 0.01,
}


def rays(survey: Survey) -> Floats:
    """Rays of all picks, z = 1."""
    camera = survey.calibration
    ray = back_project(camera.model, camera.parameters, survey.pixel_px)
    return np.asarray(ray / ray[:, 2:])


def with_one_length(survey: Survey) -> Survey:
    """The survey with its longest length alone."""
    return select_lines(survey, survey.length_m == survey.length_m.max())


def test_the_plane_is_among_those_of_opencv(scene_factory: Callable[..., Scene]) -> None:
    survey = with_one_length(scene_factory(11, **FEW_LENGTHS).survey)
    ray = rays(survey)
    ((frame, planes),) = find_shared_planes(survey, ray).items()
    normals = planes / np.linalg.norm(planes, axis=1)[:, None]
    # Every plane that is found is one of OpenCV's for the photo and some other one.
    reference = []
    for other in set(range(len(survey.frame_id))) - {frame}:
        own, theirs = (survey.pick_frame == k for k in (frame, other))
        _, one, two = np.intersect1d(
            survey.pick_label[own], survey.pick_label[theirs], return_indices=True
        )
        if len(one) < 4:
            continue
        matrix, _ = cv2.findHomography(ray[own][one, :2], ray[theirs][two, :2])
        _, _, _, found = cv2.decomposeHomographyMat(matrix, np.eye(3))
        reference += [sign * n.ravel() for n in found for sign in (1.0, -1.0)]
    for normal in normals:
        assert min(np.linalg.norm(np.array(reference) - normal, axis=1)) < 0.01


def test_a_survey_is_adjusted_though_no_photo_shows_three_lengths(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(11, **FEW_LENGTHS)
    whole, _ = refine(scene.survey, SolveOptions(noise="stated"))
    few, _ = refine(with_one_length(scene.survey), SolveOptions(noise="stated"))
    label = few.adjustment.survey.label
    assert len(label) == len(whole.adjustment.survey.label)
    one, other = (
        x.adjustment.state.point[x.adjustment.label_rows(label), :2] for x in (few, whole)
    )
    # The same shape and size; without a log its place and direction are arbitrary.
    apart, truth = (np.linalg.norm(p[:, None] - p[None], axis=-1) for p in (one, other))
    assert np.abs(apart - truth).max() < 0.01 * truth.max()


def test_points_of_stated_height_count_as_shared_points(
    scene_factory: Callable[..., Scene],
) -> None:
    """Half of the points are kerbs and corners of cars; the ground alone has fewer than six."""
    scene = scene_factory(11, **FEW_LENGTHS)
    survey, truth = with_one_length(scene.survey), scene.truth
    ends = np.append(survey.line_start, survey.line_end)
    raised = np.setdiff1d(np.arange(len(survey.label)), ends)[: len(survey.label) - 5]
    up_m = np.zeros(len(survey.label))
    up_m[raised] = np.resize([0.12, 0.7, 0.95], len(raised))
    world = scene.world + up_m[:, None] * [0.0, 0.0, 1.0]
    pixel = [
        cv_pixels(INTRINSICS, truth.center[f], truth.rotation[f], world[[k]])[0][0]
        for f, k in zip(survey.pick_frame, survey.pick_label, strict=True)
    ]
    known = replace(survey, pixel_px=np.array(pixel), height_above_m=up_m)
    ((frame, planes),) = find_shared_planes(known, rays(known)).items()
    height_m = truth.center[frame, 2] - world[0, 2]
    true = -truth.rotation[frame, 2] / height_m
    assert np.linalg.norm(planes - true, axis=1).min() < 0.005 * np.linalg.norm(true)
    refined, _ = refine(known, SolveOptions(noise="stated"))
    assert len(refined.pick_index) == len(known.pick_frame)
