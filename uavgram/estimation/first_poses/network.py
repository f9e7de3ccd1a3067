"""First values of a survey's unknowns: from the telemetry, or from lengths and known points."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.homography import Pose, other_pose, polished, resect_from_plane
from uavgram.estimation.first_poses.length_conditions import LengthFrames
from uavgram.estimation.first_poses.resection import LengthPoses, resect_from_lengths, search_frames
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.plane_pose import pose_above_plane
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey

SAME = 0.01
"""Distance between two planes, in sigmas, up to which they are the same."""


POOR = 3.0
"""Misfit of known points, in their sigmas, above which poses of any tilt are tried."""

TILTED = np.array(
    [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, -0.6, 0.8]]
)
"""Directions to the ground in the camera, from straight below to 37 degrees aside."""


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


class SeenLines(NamedTuple):
    """Known lengths that frames see whole, one row each, by frame.

    Attributes
    ----------
    frame, line
        (S,) of the survey.
    start, end
        (S,) picks of the two ends.
    """

    frame: Ints
    line: Ints
    start: Ints
    end: Ints


def seen_lines(survey: Survey) -> SeenLines:
    """Which frames see which known lengths whole, of those that a plane can start from.

    Both ends must lie in one area and stand equally high above it (others would need a ray of
    their own: they refine the pose but do not start it), and on two pixels.
    """
    labels = len(survey.label)
    key = survey.pick_frame * labels + survey.pick_label
    by_key = np.argsort(key, kind="stable")
    by_label = np.argsort(survey.pick_label, kind="stable")
    bounds = np.searchsorted(survey.pick_label[by_label], np.arange(labels + 1))
    number = np.diff(bounds)[survey.line_start]
    line = np.repeat(np.arange(len(number)), number)
    within = np.arange(len(line)) - np.repeat(np.cumsum(number) - number, number)
    start = by_label[bounds[survey.line_start[line]] + within]
    wanted = survey.pick_frame[start] * labels + survey.line_end[line]
    place = np.minimum(np.searchsorted(key[by_key], wanted), max(len(key) - 1, 0))
    end = by_key[place]
    found = key[end] == wanted
    a, b = survey.line_start[line], survey.line_end[line]
    found &= (survey.area[a] == survey.area[b]) & (
        survey.height_above_m[a] == survey.height_above_m[b]
    )
    found &= (survey.pixel_px[start] != survey.pixel_px[end]).any(axis=1)
    rows = np.flatnonzero(found)
    rows = rows[np.argsort(survey.pick_frame[start[rows]], kind="stable")]
    return SeenLines(survey.pick_frame[start[rows]], line[rows], start[rows], end[rows])


def lines_per_frame(survey: Survey) -> Ints:
    """(F,) how many known lengths each frame sees whole; one taped twice counts once."""
    return _lines_per_frame(survey, seen_lines(survey))


def _lines_per_frame(survey: Survey, seen: SeenLines) -> Ints:
    ends = np.stack([survey.pick_label[seen.start], survey.pick_label[seen.end]])
    different = np.unique(np.column_stack([seen.frame, *np.sort(ends, axis=0)]), axis=0)
    return np.bincount(different[:, 0], minlength=len(survey.frame_id))


def length_poses(survey: Survey) -> dict[int, LengthPoses]:
    """Poses over the plane that explain the lengths of each frame with three or more, best first.

    All frames are searched together, and each candidate is refined to the maximum of its own
    likelihood, with its covariance. Candidates that end in the same maximum count once.
    """
    seen = seen_lines(survey)
    enough = np.flatnonzero(_lines_per_frame(survey, seen) >= 3)
    if not len(enough):
        return {}
    frames = _length_frames(survey, seen, enough)
    searched = search_frames(survey.calibration, frames)
    row = np.repeat(np.arange(len(enough)), [len(found) for found in searched])
    start = np.array([c.plane for found in searched for c in found]).reshape(-1, 3)
    poses = resect_from_lengths(survey.calibration, frames.take(row), start)
    # Where the iterations fail, what the search found is still a first value.
    failed = ~poses.converged
    cost = np.array([c.cost for found in searched for c in found])
    poses = poses._replace(
        plane=np.where(failed[:, None], start, poses.plane),
        cost=np.where(failed, cost, poses.cost),
    )
    order = np.lexsort((poses.cost, row))
    return {
        int(enough[k]): _distinct(poses.take(order[row[order] == k]))
        for k in range(len(enough))
        if len(searched[k])
    }


def _distinct(poses: LengthPoses) -> LengthPoses:
    """Of poses that came to rest at the same plane, the first."""
    variance = np.einsum("bii->bi", poses.covariance)[:, :3]
    sigma = np.sqrt(np.where(poses.converged[:, None], variance, 0.0))
    same = np.all(np.abs(poses.plane[:, None] - poses.plane) <= SAME * sigma, axis=2)
    first = np.argmax(same, axis=0)
    return poses.take(np.flatnonzero(first == np.arange(len(first))))


def _length_frames(survey: Survey, seen: SeenLines, frame: Ints) -> LengthFrames:
    """The lines of some frames, filled up to the largest number of picks and of lines."""
    rows = np.flatnonzero(np.isin(seen.frame, frame))
    row = np.searchsorted(frame, seen.frame[rows])
    used, at = np.unique(np.stack([seen.start[rows], seen.end[rows]]), return_inverse=True)
    owner = np.searchsorted(frame, survey.pick_frame[used])
    pick_rank, line_rank = _rank(owner, len(frame)), _rank(row, len(frame))
    shape = len(frame), int(line_rank.max()) + 1
    pixel = np.zeros((len(frame), int(pick_rank.max()) + 1, 2))
    pixel[:] = survey.calibration.parameters[2:4]
    sigma = np.ones(pixel.shape[:2])
    pixel[owner, pick_rank] = survey.pixel_px[used]
    sigma[owner, pick_rank] = survey.pick_sigma_px[used]
    ends = np.zeros((2, *shape), dtype=np.int64)
    ends[1] = 1
    ends[:, row, line_rank] = pick_rank[at.reshape(2, -1)]
    length, length_sigma = np.ones(shape), np.full(shape, np.inf)
    length[row, line_rank] = survey.length_m[seen.line[rows]]
    length_sigma[row, line_rank] = survey.length_sigma_m[seen.line[rows]]
    return LengthFrames(pixel, sigma, ends[0], ends[1], length, length_sigma)


def _rank(owner: Ints, owners: int) -> Ints:
    """(n,) how many with the same owner come before each."""
    order = np.argsort(owner, kind="stable")
    first = np.searchsorted(owner[order], np.arange(owners))
    rank = np.empty(len(owner), dtype=np.int64)
    rank[order] = np.arange(len(owner)) - first[owner[order]]
    return rank


class PlaneNetwork:
    """Frames joined one by one over the plane z = 0 by the points they share."""

    def __init__(self, survey: Survey, ray: Floats) -> None:
        self._survey, self._ray = survey, ray
        self._by_frame = np.argsort(survey.pick_frame, kind="stable")
        ordered = survey.pick_frame[self._by_frame]
        self._bounds = np.searchsorted(ordered, np.arange(len(survey.frame_id) + 1))
        frames, labels = len(survey.frame_id), len(survey.label)
        self.point = np.full((labels, 2), np.nan)
        self.center = np.full((frames, 3), np.nan)
        self.rotation = np.full((frames, 3, 3), np.nan)
        self.misfit = 0.0  # the worst of a joined frame's known points, in their sigmas

    def start(self, frame: int, plane: Floats) -> None:
        """Place one frame over the origin by its own plane (3,), and its points below it."""
        center, rotation = pose_above_plane(plane)
        self.place(frame, center, rotation)

    def grow(self, planes: dict[int, Floats]) -> None:
        """Join every frame that shares enough points: two with planes of its own (n, 3), else four.

        Frames that share most come first: a poor pose would spoil all that hang on it.
        """
        waiting = [f for f in range(len(self.center)) if np.isnan(self.center[f, 0])]
        while waiting:
            shared = [-len(self._known(frame)) for frame in waiting]
            for place in np.argsort(shared, kind="stable").tolist():
                frame = waiting[place]
                pose = self._join(frame, planes.get(frame))
                if pose is not None:
                    self.place(frame, *pose)
                    waiting.remove(frame)
                    break
            else:
                return

    def _known(self, frame: int) -> Ints:
        """Its picks of points that have a place."""
        picks = self._picks(frame)
        is_known = np.isfinite(self.point[self._survey.pick_label[picks], 0])
        return np.asarray(picks[is_known])

    def _picks(self, frame: int) -> Ints:
        return self._by_frame[self._bounds[frame] : self._bounds[frame + 1]]

    def _join(self, frame: int, planes: Floats | None) -> Pose | None:
        """The pose that shows the known points best: of either tilt, or over a plane of its own."""
        known = self._known(frame)
        label = self._survey.pick_label[known]
        target, ray = self.point[label], self._ray[known]
        starts = self._over([] if planes is None else planes, known)
        if len(known) < 4:
            return starts[0] if starts else None
        direct = resect_from_plane(target, ray)
        if direct is None:
            return starts[0] if starts else None
        if self._survey.height_above_m[label].any():  # off the plane that the others are for
            return direct
        found = _best([direct, other_pose(direct, target), *starts], target, ray)
        focal_px = self._survey.calibration.parameters[0]
        sigma = self._survey.pick_sigma_px[known] / focal_px
        if found is None or found[0] > POOR**2 * np.sum(sigma**2):
            size = np.ptp(ray[:, :2], axis=0).max() / np.ptp(target, axis=0).max()
            searched = _best(self._over(size * TILTED, known), target, ray)
            found = min(filter(None, [found, searched]), key=lambda end: end[0], default=None)
        if found is None:
            return direct
        self.misfit = max(self.misfit, float(np.sqrt(found[0] / np.sum(sigma**2))))
        return found[1]

    def _over(self, planes: Iterable[Floats], known: Ints) -> list[Pose]:
        """Poses over planes of the frame's own that reach two known points or more."""
        target = self.point[self._survey.pick_label[known]]
        poses = (self._aligned(plane, known, target) for plane in planes)
        return [pose for pose in poses if pose is not None]

    def _aligned(self, plane: Floats, known: Ints, target: Floats) -> Pose | None:
        """The pose over a plane of its own, turned and shifted onto two known points or more."""
        center, rotation = pose_above_plane(plane)
        local = self._ground_points(center, rotation, known)
        meets = np.isfinite(local[:, 0])  # its own plane may not reach a point that others see
        if meets.sum() < 2:
            return None
        turn, shift = align_in_plane(local[meets], target[meets])
        return turn @ center + shift, turn @ rotation

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
        new = np.isnan(self.point[label, 0])
        self.point[label[new]] = self._ground_points(center, rotation, picks[new])

    def _ground_points(self, center: Floats, rotation: Floats, picks: Ints) -> Floats:
        height = self._survey.height_above_m[self._survey.pick_label[picks]]
        direction = self._ray[picks] @ rotation.T
        ground = intersect_ground(
            np.broadcast_to(center, direction.shape), direction, np.zeros(3), np.zeros(2), height
        )
        return np.asarray(ground[:, :2])


def _best(starts: list[Pose], target: Floats, ray: Floats) -> tuple[float, Pose] | None:
    """The pose that shows points (n, 2) on rays (n, 3) best, from several first values."""
    ends = (polished(pose, target, ray) for pose in starts)
    return min(filter(None, ends), key=lambda end: end[0], default=None)


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
