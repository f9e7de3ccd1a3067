"""Frames without telemetry, joined one by one over a plane by the points that they share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.homography import Pose, other_pose, polished, resect_from_plane
from uavgram.estimation.first_poses.network import placing
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.plane_pose import pose_above_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

POOR = 3.0
"""Misfit of known points, in their sigmas, above which a frame waits for others to join first."""


class _Joined(NamedTuple):
    """A pose, and the misfit of the known points under it, in their sigmas."""

    misfit: float
    pose: Pose


class PlaneNetwork:
    """Frames joined one by one over the plane z = 0 by the points they share."""

    def __init__(self, survey: Survey, ray: Floats) -> None:
        self._survey, self._ray, self._placing = survey, ray, placing(survey)
        self._by_frame = np.argsort(survey.pick_frame, kind="stable")
        ordered = survey.pick_frame[self._by_frame]
        self._bounds = np.searchsorted(ordered, np.arange(len(survey.frame_id) + 1))
        frames, labels = len(survey.frame_id), len(survey.label)
        self.point = np.full((labels, 2), np.nan)
        self.center = np.full((frames, 3), np.nan)
        self.rotation = np.full((frames, 3, 3), np.nan)
        self._tried: dict[tuple[int, int], _Joined | None] = {}  # by frame and number of points

    def place(self, frame: int, center: Floats, rotation: Floats) -> None:
        """Give a frame a pose (3,), (3, 3) over the plane, and its points their places below it.

        Parameters
        ----------
        frame
            Its index.
        center, rotation
            (3,) [m], (3, 3) world from camera.
        """
        self.center[frame], self.rotation[frame] = center, rotation
        picks = self._picks(frame)
        label = self._survey.pick_label[picks]
        new = np.isnan(self.point[label, 0]) & ~self._survey.is_free[label]
        self.point[label[new]] = self._ground_points(center, rotation, picks[new])

    def grow(self, planes: Mapping[int, Floats]) -> None:
        """Join every frame that shares enough points: two with planes of its own (n, 3), else four.

        Frames that share most come first. One that does not fit places no points for others until
        nothing else can be joined: a false pose would spoil all that hang on it.
        """
        waiting = set(np.flatnonzero(np.isnan(self.center[:, 0])).tolist())
        while waiting:
            found = self._next(waiting, planes)
            if found is None:
                return
            frame, pose = found
            self.place(frame, *pose)
            waiting.remove(frame)

    def _next(self, waiting: set[int], planes: Mapping[int, Floats]) -> tuple[int, Pose] | None:
        """The frame to join next, and its pose."""
        known = self._is_known(self._survey.pick_label)
        shared = np.bincount(self._survey.pick_frame[known], minlength=len(self.center))
        poor: list[tuple[float, int, Pose]] = []
        for frame in sorted(waiting, key=lambda f: (-shared[f], f)):
            key = frame, int(shared[frame])
            if key not in self._tried:
                self._tried[key] = self._join(frame, planes.get(frame, np.zeros((0, 3))))
            joined = self._tried[key]
            if joined is not None and joined.misfit <= POOR:
                return frame, joined.pose
            if joined is not None:
                poor.append((joined.misfit, frame, joined.pose))
        return min(poor, key=lambda one: one[:2])[1:] if poor else None

    def _picks(self, frame: int) -> Ints:
        return self._by_frame[self._bounds[frame] : self._bounds[frame + 1]]

    def _is_known(self, label: Ints) -> Bools:
        """(n,) whether points have a place that may tell where a frame is."""
        return np.asarray(~self._survey.is_free[label] & np.isfinite(self.point[label, 0]))

    def _join(self, frame: int, planes: Floats) -> _Joined | None:
        """The pose that shows the known points best: of either tilt, or over a plane of its own."""
        picks = self._picks(frame)
        known = picks[self._is_known(self._survey.pick_label[picks])]
        firm = known[self._placing[self._survey.pick_label[known]]]
        known = firm if len(firm) >= 4 else known
        label = self._survey.pick_label[known]
        target, ray = self.point[label], self._ray[known]
        starts = self._over(planes, known, target)
        height = self._survey.height_above_m[label]
        flat = height == 0.0 if np.sum(height == 0.0) >= 4 else height < np.inf
        direct = resect_from_plane(target[flat], ray[flat]) if len(known) >= 4 else None
        if direct is None:
            return _Joined(0.0, starts[0]) if starts else None
        world = np.column_stack([target, height])
        sigma = self._survey.pick_sigma_px[known] / self._survey.calibration.parameters[0]
        ends = (
            polished(pose, world, ray, sigma)
            for pose in (direct, other_pose(direct, target[flat]), *starts)
        )
        found = min(filter(None, ends), key=lambda end: end[0], default=(np.inf, direct))
        return _Joined(float(np.sqrt(found[0] / len(known))), found[1])

    def _over(self, planes: Iterable[Floats], known: Ints, target: Floats) -> list[Pose]:
        """Poses over planes of the frame's own, turned and shifted onto known points (n, 2).

        Those that reach two of them or more: its own plane may not reach a point that others see.
        """
        poses = []
        for plane in planes:
            center, rotation = pose_above_plane(plane)
            local = self._ground_points(center, rotation, known)
            meets = np.isfinite(local[:, 0])
            if meets.sum() >= 2:
                turn, shift = align_in_plane(local[meets], target[meets])
                poses.append((turn @ center + shift, turn @ rotation))
        return poses

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
