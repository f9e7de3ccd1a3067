"""Sigmas of an estimator that knows the true sizes of all errors: first order, at the truth.

Unknowns, as deviations from the truth: pose of each photo, lens, plane, each label's place, height
and identification, the tape's scale, and what the log's errors have in common. Gross errors are
not in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from trust_conditions import LINE_SIGMA_M, World
from trust_world import Floats, Pose, Survey, body_turn, project, true_value, turn_of

ANYTHING = 1e3
"""Sigma of what nothing is known of: metres, radians."""
FREE_HEIGHT_M = 3.0
AUTO_SIGMA = np.array([26.0, 26.0, 20.0, 20.0, 0.006, 0.01, 0.0005, 0.0005, 0.003])
RELIEF_LENGTH_M = 1.5
CLOCK_ERROR_S = 0.03


def oracle_sigmas(survey: Survey, world: World) -> list[float]:
    """Sigma of each measurement."""
    labels = list(survey.meant)
    photos = len(survey.poses)
    start = 6 * photos  # lens, plane, scale, then e, n, z, and offsets of each label
    size = start + 9 + 3 + 1 + 5 * len(labels)
    at = {label: start + 13 + 5 * k for k, label in enumerate(labels)}
    information = np.zeros((size, size))
    _add_picks(information, survey, world, start, at)
    _add_lines(information, survey, world, start, at)
    for label, stated in survey.control.items():
        rows = _point_rows(survey, label, stated, start, at, size)
        information += rows.T @ rows / 0.02**2
    _add_priors(information, survey, world, start, at)
    scale = 1 / np.sqrt(np.diag(information))
    covariance = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    covariance *= np.outer(scale, scale)
    sigmas = []
    for name, kind, points in survey.measure:
        del name
        row = _measured_row(survey, kind, points, start, at, size)
        variance = float(row @ covariance @ row)
        if kind == "height":
            variance += world.relief_m**2
        sigmas.append(float(np.sqrt(max(variance, 0.0))))
    return sigmas


def _point_rows(
    survey: Survey, label: str, place: Floats, start: int, at: dict[str, int], size: int
) -> Floats:
    """(3, size) of a meant point by the unknowns."""
    rows = np.zeros((3, size))
    local = place[:2] - survey.ground.middle
    rows[2, start + 9 : start + 12] = 1.0, *local
    k = at[label]
    rows[0, k] = rows[1, k + 1] = rows[2, k + 2] = 1.0
    rows[2, k : k + 2] = survey.ground.slope
    return rows


def _add_picks(
    information: Floats, survey: Survey, world: World, start: int, at: dict[str, int]
) -> None:
    size = len(information)
    for photo, pose in enumerate(survey.poses):
        names = [pick.label for pick in survey.picks if pick.photo == photo]
        names = [name for name in names if name in survey.picked]
        if not names:
            continue
        points = np.array([survey.picked[name] for name in names])
        by_pose, by_lens, by_point = _derivatives(survey.lens.true, pose, points)
        for k, name in enumerate(names):
            rows = np.zeros((2, size))
            rows[:, 6 * photo : 6 * photo + 6] = by_pose[k]
            rows[:, start : start + 9] = by_lens[k]
            at_point = _point_rows(survey, name, points[k], start, at, size)
            column = at[name] + 3
            at_point[0, column] = at_point[1, column + 1] = 1.0
            at_point[2, column : column + 2] = survey.ground.slope
            rows += by_point[k] @ at_point
            information += rows.T @ rows / world.pick_px**2


def _derivatives(lens: Floats, pose: Pose, points: Floats) -> tuple[Floats, Floats, Floats]:
    """(n, 2, 6) by pose, (n, 2, 9) by lens, (n, 2, 3) by point: central differences."""

    def central(change: Callable[[Floats], Floats], steps: Floats) -> Floats:
        columns = []
        for k, step in enumerate(steps):
            delta = np.zeros(len(steps))
            delta[k] = step
            ahead, behind = change(delta), change(-delta)
            columns.append((ahead - behind) / (2 * step))
        return np.stack(columns, axis=-1)

    def moved(delta: Floats) -> Floats:
        turn = pose.rotation @ turn_of(delta[3:])
        return project(lens, Pose(center=pose.center + delta[:3], rotation=turn), points)[0]

    by_pose = central(moved, np.array([1e-3] * 3 + [1e-5] * 3))
    by_lens = central(
        lambda delta: project(lens + delta, pose, points)[0], np.array([0.1] * 4 + [1e-4] * 5)
    )
    by_point = central(lambda delta: project(lens, pose, points + delta)[0], np.full(3, 1e-3))
    return by_pose, by_lens, by_point


def _add_lines(
    information: Floats, survey: Survey, world: World, start: int, at: dict[str, int]
) -> None:
    sigma = np.hypot(LINE_SIGMA_M, world.rounded_m / np.sqrt(12))
    size = len(information)
    for line in survey.lines:
        row = _measured_row(survey, "distance", line.ends, start, at, size)
        length = survey.meant[line.ends[0]] - survey.meant[line.ends[1]]
        row[start + 12] = np.linalg.norm(length)
        information += np.outer(row, row) / sigma**2


def _measured_row(
    survey: Survey, kind: str, points: tuple[str, ...], start: int, at: dict[str, int], size: int
) -> Floats:
    """(size,) of a measurement by the unknowns."""
    row = np.zeros(size)
    if kind == "height" and len(points) == 1:
        row[at[points[0]] + 2] = 1.0
        return row
    for label in points:
        rows = _point_rows(survey, label, survey.meant[label], start, at, size)
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = 1e-4
            ends = []
            for sign in (1, -1):
                meant = survey.meant | {label: survey.meant[label] + sign * step}
                ends.append(true_value(replace(survey, meant=meant), kind, points))
            row += (ends[0] - ends[1]) / 2e-4 * rows[axis]
    return row


def _add_priors(
    information: Floats, survey: Survey, world: World, start: int, at: dict[str, int]
) -> None:
    sigma = np.full(len(information), ANYTHING)
    sigma[start : start + 9] = AUTO_SIGMA if world.camera_auto else survey.lens.sigma
    sigma[start + 12] = max(world.tape_scale, 1e-9)
    if world.log is not None or survey.control:
        sigma[start + 9 : start + 12] = 0.25, 0.05, 0.05
    for k in at.values():
        sigma[k + 3 : k + 5] = max(world.identified_m, 1e-6)
    heights = np.array([k + 2 for k in at.values()])
    sigma[heights] = np.inf
    information[np.diag_indices(len(information))] += 1 / sigma**2
    places = np.array([survey.meant[label][:2] for label in at])
    far2 = ((places[:, None] - places[None]) ** 2).sum(axis=-1)
    own = world.own_m**2 + (world.kerb_m / 2) ** 2 + 1e-10
    covariance = world.relief_m**2 * np.exp(-far2 / (2 * RELIEF_LENGTH_M**2))
    covariance[np.diag_indices(len(covariance))] += own
    for k, label in enumerate(at):
        if any(p.label == label and p.extra.get("height_m") == "free" for p in survey.picks):
            covariance[k, k] += FREE_HEIGHT_M**2
    information[np.ix_(heights, heights)] += np.linalg.inv(covariance)
    if world.log is not None:
        _add_log(information, survey, world)


def _add_log(information: Floats, survey: Survey, world: World) -> None:
    """Priors of all poses together: what they have in common does not average away."""
    rtk = world.log == "rtk"
    count = len(survey.poses)
    time = 4.0 * np.arange(count)
    tau = 4.0 if rtk else 15.0
    # Smoothness that no estimator could count on is not used: correlations fall exponentially.
    alike = np.exp(-np.abs(time[:, None] - time[None]) / tau)
    turning = np.exp(-np.abs(time[:, None] - time[None]) / 15.0)
    track = np.array([pose.center for pose in survey.poses])
    velocity = np.gradient(track, time, axis=0) if count > 1 else np.zeros_like(track)
    wander = np.array([0.01, 0.01, 0.02] if rtk else [0.35, 0.35, 0.35])
    bias = np.array([0.008, 0.008, 0.015] if rtk else [1.5, 1.5, 2.0])
    covariance = np.zeros((6 * count, 6 * count))
    tilted = np.radians([0.7, 0.7, 1.3])
    for i, one in enumerate(survey.poses):
        for j, two in enumerate(survey.poses):
            block = np.zeros((6, 6))
            block[:3, :3] = np.diag(bias**2 + alike[i, j] * wander**2)
            block[:3, :3] += 0.06**2 * _body(one) @ _body(two).T
            block[:3, :3] += CLOCK_ERROR_S**2 * np.outer(velocity[i], velocity[j])
            errors = turning[i, j] * np.diag(tilted**2)
            errors[2, 2] += np.radians(1.3) ** 2
            block[3:, 3:] = one.rotation.T @ _body(one) @ errors @ _body(two).T @ two.rotation
            block[3:, 3:] += np.radians(1.2) ** 2 * np.eye(3)
            covariance[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = block
    covariance[np.diag_indices(len(covariance))] += 1e-10
    information[: 6 * count, : 6 * count] += np.linalg.inv(covariance)


def _body(pose: Pose) -> Floats:
    """Axes forward, right, down of a level vehicle that heads where the photo's right edge asks."""
    east, north = pose.rotation[:2, 0]  # to the right in the picture: the vehicle's right
    return body_turn(0.0, 0.0, float(np.arctan2(-north, east)))
