"""Joining of frames over a plane, by known things and by shared points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.first_values import SeenLines, find_seen_lines, has_known_height
from uavgram.estimation.first_poses.plane_search import (
    SCALED_KINDS,
    KnownPlanes,
    PlaneThing,
    count_rows,
    search_known_planes,
)
from uavgram.estimation.first_poses.resection import (
    Pose,
    find_second_pose,
    refine_pose,
    resect_from_plane,
)
from uavgram.estimation.survey.known_kinds import ALL_KINDS
from uavgram.geometry.ground.plane import intersect_ground, pose_above_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey

MAX_RMS_SIGMAS = 3.0
"""RMS residual of known points, in their sigmas, above which a frame waits for others to join
first."""


class _JoinedPose(NamedTuple):
    """Pose, and the RMS residual of the known points under it, in their sigmas."""

    misfit: float
    pose: Pose


class PlaneNetwork:
    """Frames joined one by one over the plane z = 0 by shared points."""

    def __init__(self, survey: Survey, ray: Floats) -> None:
        self._survey, self._ray, self._placing = survey, ray, has_known_height(survey)
        self._by_frame = np.argsort(survey.pick_frame, kind="stable")
        ordered = survey.pick_frame[self._by_frame]
        self._bounds = np.searchsorted(ordered, np.arange(len(survey.frame_id) + 1))
        frames, labels = len(survey.frame_id), len(survey.label)
        self.point = np.full((labels, 2), np.nan)
        self.center = np.full((frames, 3), np.nan)
        self.rotation = np.full((frames, 3, 3), np.nan)
        # By frame and number of known points.
        self._tried: dict[tuple[int, int], _JoinedPose | None] = {}

    def place(self, frame: int, center: Floats, rotation: Floats) -> None:
        """Set the pose (3,), (3, 3) of a frame over the plane, and the places of its new points.

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
        """Join all frames with enough shared points: two with planes (n, 3) of their own, or four.

        Frames that share most points come first. One that does not fit places no points for others
        until nothing else can be joined: a false pose would spoil all frames that depend on it.
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
        """Return the frame to join next, and its pose."""
        known = self._is_known(self._survey.pick_label)
        shared = np.bincount(self._survey.pick_frame[known], minlength=len(self.center))
        poor: list[tuple[float, int, Pose]] = []
        for frame in sorted(waiting, key=lambda f: (-shared[f], f)):
            key = frame, int(shared[frame])
            if key not in self._tried:
                self._tried[key] = self._join(frame, planes.get(frame, np.zeros((0, 3))))
            joined = self._tried[key]
            if joined is not None and joined.misfit <= MAX_RMS_SIGMAS:
                return frame, joined.pose
            if joined is not None:
                poor.append((joined.misfit, frame, joined.pose))
        return min(poor, key=lambda one: one[:2])[1:] if poor else None

    def _picks(self, frame: int) -> Ints:
        return self._by_frame[self._bounds[frame] : self._bounds[frame + 1]]

    def _is_known(self, label: Ints) -> Bools:
        """Mark the points (n,) with a place that may determine the pose of a frame."""
        return np.asarray(~self._survey.is_free[label] & np.isfinite(self.point[label, 0]))

    def _join(self, frame: int, planes: Floats) -> _JoinedPose | None:
        """Find the best pose for the known points: of either tilt, or over a plane of its own."""
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
            return _JoinedPose(0.0, starts[0]) if starts else None
        world = np.column_stack([target, height])
        sigma = self._survey.pick_sigma_px[known] / self._survey.calibration.parameters[0]
        poses = (direct, find_second_pose(direct, target[flat]), *starts)
        found = refine_pose(poses, world, ray, sigma) or (np.inf, direct)
        return _JoinedPose(float(np.sqrt(found[0] / len(known))), found[1])

    def _over(self, planes: Iterable[Floats], known: Ints, target: Floats) -> list[Pose]:
        """Return poses over the frame's own planes, turned and shifted onto known points (n, 2).

        Only poses that reach at least two of them: its own plane may not reach a point that others
        see.
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
    """Compute rotation about up (3, 3) and shift (3,) of points (n, 2) onto others, n >= 2.

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


KIND_NAMES = {
    "length": ("length", "lengths"),
    "distance": ("length", "lengths"),
    "horizontal_distance": ("length", "lengths"),
    "polyline": ("length", "lengths"),
    "line_distance": ("distance from a line", "distances from a line"),
    "area": ("area", "areas"),
    "angle": ("angle", "angles"),
    "right_angle": ("right angle", "right angles"),
    "parallel": ("pair of parallel lines", "pairs of parallel lines"),
    "equal_lengths": ("pair of equal lengths", "pairs of equal lengths"),
}
"""Names of each kind, singular and plural."""


class FrameThings(NamedTuple):
    """Known lengths and other quantities between points that one frame shows on one level ground.

    Attributes
    ----------
    things
        With picks of the survey.
    number
        Number of each among the project's known things; -1: a length of the table.
    rows
        Number of rows that constrain the pose; lengths between the same two points count once.
    """

    things: tuple[PlaneThing, ...]
    number: tuple[int, ...]
    rows: int

    @property
    def scaled(self) -> bool:
        """Return whether a length or a known distance determines the scale."""
        return any(one.kind in SCALED_KINDS for one in self.things)

    def words(self) -> str:
        """Return their names: "2 lengths and 1 right angle"."""
        number: Counter[tuple[str, str]] = Counter()
        for one in self.things:
            number[KIND_NAMES[one.kind]] += count_rows(one.kind, len(one.pick))
        parts = [f"{n} {words[n > 1]}" for words, n in number.items()]
        return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def count_known_rows(survey: Survey) -> int:
    """Count the rows of known things, except lengths of the table, that constrain poses."""
    things = [one for one in survey.known if _constrains_plane(survey, one)]
    return sum(count_rows(one.kind, len(one.label)) for one in things)


def find_frame_things(survey: Survey) -> dict[int, FrameThings]:
    """Return the known things of each frame that shows all points of any thing but a length."""
    found = _find_seen_things(survey)
    if not found:
        return {}
    lines = find_seen_lines(survey)
    return {f: _collect(survey, lines, f, things) for f, things in sorted(found.items())}


def find_known_planes(
    survey: Survey, ray: Floats, seen: Mapping[int, FrameThings], without: Collection[int] = ()
) -> dict[int, KnownPlanes]:
    """Search planes that lengths and other known things together allow, for each frame.

    Parameters
    ----------
    survey
        Observations.
    ray
        (P, 3) undistorted rays of its picks, z = 1.
    seen
        Result of `find_frame_things`.
    without
        Frames whose planes are known already.
    """
    sigma = survey.pick_sigma_px / survey.calibration.parameters[0]
    found = {}
    for frame, known in seen.items():
        if frame not in without and known.rows >= 3:
            planes = search_known_planes(ray, sigma, known.things)
            if len(planes.plane):
                found[frame] = planes
    return found


def _find_seen_things(survey: Survey) -> dict[int, list[tuple[int, PlaneThing]]]:
    """Return known things with numbers, except the table's lengths, by frames that show all points.

    The points must be on the ground, or at equal stated heights above it, in one area.
    """
    found: dict[int, list[tuple[int, PlaneThing]]] = {}
    for one in survey.known:
        if not _constrains_plane(survey, one):
            continue
        picks = [
            dict(zip(survey.pick_frame[rows].tolist(), rows.tolist(), strict=True))
            for rows in (np.flatnonzero(survey.pick_label == k) for k in one.label)
        ]
        for frame in set(picks[0]).intersection(*picks[1:]):
            at = tuple(by_frame[frame] for by_frame in picks)
            value = one.value if ALL_KINDS[one.kind].has_value else 0.0
            thing = PlaneThing(one.kind, at, value, one.sigma)
            found.setdefault(frame, []).append((one.index, thing))
    return found


def _constrains_plane(survey: Survey, thing: KnownThing) -> bool:
    """Return whether a thing constrains planes: points on one level, not true on every plane."""
    label = list(thing.label)
    if thing.position is not None:  # it constrains the place of a frame, not the plane
        return False
    level = all(len(set(of[label])) == 1 for of in (survey.area, survey.height_above_m))
    # Points in line (a distance of zero from a line, an angle of 0 or 180 degrees) hold on all.
    in_line = ALL_KINDS[thing.kind].has_value and not 0.0 < thing.value < (
        180.0 if thing.kind == "angle" else np.inf
    )
    rows = count_rows(thing.kind, len(label))
    return bool(rows and level and not in_line and has_known_height(survey)[label].all())


def _collect(
    survey: Survey, lines: SeenLines, frame: int, things: list[tuple[int, PlaneThing]]
) -> FrameThings:
    """Collect a frame's things and its known lengths; one pair of points counts once."""
    rows: Ints = np.flatnonzero(lines.frame == frame)
    known = [
        PlaneThing(
            "distance",
            (int(lines.start[k]), int(lines.end[k])),
            float(survey.length_m[lines.line[k]]),
            float(lines.sigma_m[k]),
        )
        for k in rows
    ]
    together = (*known, *(one for _, one in things))
    numbers = (*(-1 for _ in known), *(number for number, _ in things))
    different = {
        (KIND_NAMES[one.kind], frozenset(one.pick), one.pick[1:-1]): one for one in together
    }
    number = sum(count_rows(one.kind, len(one.pick)) for one in different.values())
    return FrameThings(together, numbers, number)
