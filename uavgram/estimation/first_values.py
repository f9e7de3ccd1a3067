"""First values of a survey's unknowns: from the telemetry, or from lengths and known points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.plane_pose import PlaneCandidate, search_plane
from uavgram.estimation.plane_resection import resect_from_plane
from uavgram.geometry.ground import intersect_ground
from uavgram.geometry.plane_pose import pose_above_plane
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey


class FirstValues(NamedTuple):
    """First values; NaN where nothing determines them.

    Attributes
    ----------
    point_m
        (K, 2) east and north.
    center, rotation
        (F, 3), (F, 3, 3) world from camera.
    height_m
        Of the plane.
    """

    point_m: Floats
    center: Floats
    rotation: Floats
    height_m: float


def from_telemetry(survey: Survey, ray: Floats) -> FirstValues:
    """Points where the picks' rays (P, 3) from the seeds meet the plane, averaged over frames."""
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    frame, label = survey.pick_frame, survey.pick_label
    direction = np.einsum("nij,nj->ni", seeds.world_from_camera[frame], ray)
    plane = np.array([survey.ground.height_m, 0.0, 0.0])
    ground = intersect_ground(
        seeds.center_world_m[frame], direction, plane, np.zeros(2), survey.height_above_m[label]
    )
    point = _mean_by_label(ground[:, :2], label, len(survey.label))
    return FirstValues(point, seeds.center_world_m, seeds.world_from_camera, plane[0])


def length_candidates(survey: Survey, ray: Floats, frame: int) -> tuple[PlaneCandidate, ...]:
    """Planes that explain the known lengths seen whole in one frame; empty below three."""
    start, end, line = _lines_in_frame(survey, frame)
    if len(line) < 3:
        return ()
    along_px = np.linalg.norm(survey.pixel_px[start] - survey.pixel_px[end], axis=1)
    pick_sigma_px = np.hypot(survey.pick_sigma_px[start], survey.pick_sigma_px[end])
    # A pick's error in metres: the line's own scale, metres per pixel along it.
    pick_sigma_m = survey.length_m[line] * pick_sigma_px / np.maximum(along_px, 1.0)
    sigma = np.hypot(survey.length_sigma_m[line], pick_sigma_m)
    return search_plane(ray[start], ray[end], survey.length_m[line], sigma)


def lines_per_frame(survey: Survey) -> Ints:
    """(F,) how many known lengths each frame sees whole."""
    counts = [len(_lines_in_frame(survey, f)[2]) for f in range(len(survey.frame_id))]
    return np.array(counts, dtype=np.int64)


def _lines_in_frame(survey: Survey, frame: int) -> tuple[Ints, Ints, Ints]:
    """Picks of both ends, and indices, of the known lengths seen whole in a frame."""
    pick_of_label = np.full(len(survey.label), -1)
    picks = np.flatnonzero(survey.pick_frame == frame)
    pick_of_label[survey.pick_label[picks]] = picks
    start, end = pick_of_label[survey.line_start], pick_of_label[survey.line_end]
    # A known height would need its own ray; such lines refine the pose but do not start it.
    level = survey.height_above_m[survey.line_start] == survey.height_above_m[survey.line_end]
    line = np.flatnonzero((start >= 0) & (end >= 0) & level)
    # Both ends picked on the same pixel: no plane gives that line a length.
    apart = (survey.pixel_px[start[line]] != survey.pixel_px[end[line]]).any(axis=1)
    line = line[apart]
    return start[line], end[line], line


class PlaneNetwork:
    """Frames joined one by one over the plane z = 0 by the points they share."""

    def __init__(self, survey: Survey, ray: Floats) -> None:
        self._survey, self._ray = survey, ray
        frames, labels = len(survey.frame_id), len(survey.label)
        self.point = np.full((labels, 2), np.nan)
        self.center = np.full((frames, 3), np.nan)
        self.rotation = np.full((frames, 3, 3), np.nan)

    def place_points(self, label: Ints, point_m: Floats) -> None:
        """Give points (n, 2) coordinates, such as those of control points."""
        self.point[label] = point_m

    def start(self, frame: int, plane: Floats) -> None:
        """Place one frame over the origin by its own plane (3,), and its points below it."""
        center, rotation = pose_above_plane(plane)
        self._place(frame, center, rotation)

    def grow(self, planes: dict[int, Floats]) -> None:
        """Join every frame that shares enough points: two with a plane of its own, else four."""
        waiting = [f for f in range(len(self.center)) if np.isnan(self.center[f, 0])]
        progress = True
        while waiting and progress:
            progress = False
            for frame in list(waiting):
                pose = self._join(frame, planes.get(frame))
                if pose is not None:
                    self._place(frame, *pose)
                    waiting.remove(frame)
                    progress = True

    def _join(self, frame: int, plane: Floats | None) -> tuple[Floats, Floats] | None:
        picks = np.flatnonzero(self._survey.pick_frame == frame)
        known = picks[np.isfinite(self.point[self._survey.pick_label[picks], 0])]
        target = self.point[self._survey.pick_label[known]]
        if len(known) >= 4:
            pose = resect_from_plane(target, self._ray[known])
            if pose is not None:
                return pose
        if plane is None or len(known) < 2:
            return None
        center, rotation = pose_above_plane(plane)
        local = self._ground_points(center, rotation, known)
        meets = np.isfinite(local[:, 0])  # its own plane may not reach a point that others see
        if meets.sum() < 2:
            return None
        turn, shift = align_in_plane(local[meets], target[meets])
        return turn @ center + shift, turn @ rotation

    def _place(self, frame: int, center: Floats, rotation: Floats) -> None:
        self.center[frame], self.rotation[frame] = center, rotation
        picks = np.flatnonzero(self._survey.pick_frame == frame)
        label = self._survey.pick_label[picks]
        new = np.isnan(self.point[label, 0])
        self.point[label[new]] = self._ground_points(center, rotation, picks[new])

    def _ground_points(self, center: Floats, rotation: Floats, picks: Ints) -> Floats:
        height = self._survey.height_above_m[self._survey.pick_label[picks]]
        direction = self._ray[picks] @ rotation.T
        ground = intersect_ground(
            np.broadcast_to(center, direction.shape), direction, np.zeros(3), np.zeros(2), height
        )
        return np.asarray(ground[:, :2])


def align_in_plane(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Rotation about up (3, 3) and shift (3,) that bring points (n, 2) onto others, n >= 2.

    Least squares in closed form (Umeyama 1991 in two dimensions, scale 1).
    """
    from_source, from_target = source - source.mean(axis=0), target - target.mean(axis=0)
    cosine = np.sum(from_source * from_target)
    sine = np.sum(from_source[:, 0] * from_target[:, 1] - from_source[:, 1] * from_target[:, 0])
    angle = np.arctan2(sine, cosine)
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    shift = np.zeros(3)
    shift[:2] = target.mean(axis=0) - turn[:2, :2] @ source.mean(axis=0)
    return turn, shift


def _mean_by_label(value: Floats, label: Ints, count: int) -> Floats:
    """(count, 2) mean of the finite rows of each label; NaN where there is none."""
    finite = np.isfinite(value).all(axis=1)
    total = np.zeros((count, 2))
    np.add.at(total, label[finite], value[finite])
    number = np.bincount(label[finite], minlength=count)
    return np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)
