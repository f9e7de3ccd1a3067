"""Methods to find the pose of one photo, compared on the same scenes with the same information."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.known_lines import compute_direct_poses, find_poses_from_lines
from uavgram.estimation.first_poses.known_points import MIN_POINTS, find_poses_from_points
from uavgram.estimation.first_poses.length_poses import LengthFrames, search_frames
from uavgram.estimation.first_poses.photo_problem import (
    PhotoProblem,
    Photos,
    SharedErrors,
    State,
)
from uavgram.estimation.first_poses.resection import LineRows
from uavgram.estimation.repeated.single_photo import adjust_photos, intersect_ground
from uavgram.geometry.camera.projection import back_project_with_jacobian
from uavgram.geometry.ground.plane import pose_above_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.simulation import MethodRow
from uavgram.synthetic.single_photos import LOG_SIGMA, MethodScenes, Setting, draw_scenes

Starts = tuple[Floats, Floats]
"""Centres (B, S, 3) and rotations (B, S, 3, 3) of S starts of each scene; NaN: no more."""


def make_line_rows(scenes: MethodScenes) -> LineRows:
    """Return the picks of the scenes' lines, for a first pose."""
    count = len(scenes.pixel_px)
    ray, by_pixel, _ = back_project_with_jacobian(
        scenes.calibration.model,
        scenes.calibration.parameters,
        scenes.pixel_px.reshape(count, -1, 2),
    )
    along = scenes.place_m[:, :, 1] - scenes.place_m[:, :, 0]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return LineRows(
        ray=ray,
        ray_root=by_pixel[..., :2, :] * scenes.pick_sigma_px,
        start_m=scenes.place_m.reshape(count, -1, 2),
        along=np.repeat(along, 2, axis=1),
        sigma_m=np.full(ray.shape[:2], scenes.place_sigma_m),
    )


def find_line_starts(scenes: MethodScenes) -> Starts:
    """Return the best poses of the search with lines."""
    ends = find_poses_from_lines(make_line_rows(scenes))
    some = np.isfinite(ends.cost)[..., None]
    return np.where(some, ends.state[0], np.nan), np.where(some[..., None], ends.state[1], np.nan)


def find_point_starts(scenes: MethodScenes) -> Starts:
    """Return both poses of OpenCV's IPPE; it takes four points."""
    count = len(scenes.pixel_px)
    center, rotation = np.full((count, 2, 3), np.nan), np.full((count, 2, 3, 3), np.nan)
    start = scenes.pixel_px[:, :, 0]
    ray, _, _ = back_project_with_jacobian(
        scenes.calibration.model, scenes.calibration.parameters, start
    )
    place = scenes.place_m[:, :, 0]
    world = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=-1)
    for k in range(count if start.shape[1] >= MIN_POINTS else 0):
        found = find_poses_from_points(world[k], ray[k])
        if found is not None:
            some = min(2, len(found[0]))
            center[k, :some], rotation[k, :some] = found[0][:some], found[1][:some]
    return center, rotation


def find_length_starts(scenes: MethodScenes, most: int = 4) -> Starts:
    """Return poses above the planes that explain the lengths, with the origin as foot point."""
    count, lines = scenes.pixel_px.shape[:2]
    end = np.broadcast_to(np.arange(2 * lines), (count, 2 * lines))
    frames = LengthFrames(
        pixel_px=scenes.pixel_px.reshape(count, -1, 2),
        pixel_sigma_px=np.full((count, 2 * lines), scenes.pick_sigma_px),
        start=end[:, ::2],
        end=end[:, 1::2],
        length_m=scenes.length_m,
        length_sigma_m=np.full(scenes.length_m.shape, scenes.length_sigma_m),
    )
    center, rotation = np.full((count, most, 3), np.nan), np.full((count, most, 3, 3), np.nan)
    for k, candidates in enumerate(search_frames(scenes.calibration, frames)):
        for j, plane in enumerate(candidates.plane[:most]):
            center[k, j], rotation[k, j] = pose_above_plane(plane)
    return center, rotation


def get_log_starts(scenes: MethodScenes) -> Starts:
    """Return the logged poses."""
    return scenes.logged[0][:, None], scenes.logged[1][:, None]


def find_all_starts(scenes: MethodScenes) -> Starts:
    """Return the poses of IPPE and the logged ones."""
    starts = find_point_starts(scenes), get_log_starts(scenes)
    center, rotation = (np.concatenate(part, axis=1) for part in zip(*starts, strict=True))
    return center, rotation


def find_direct_starts(scenes: MethodScenes) -> Starts:
    """Return the direct linear transformation of lines."""
    center, rotation = compute_direct_poses(make_line_rows(scenes))
    return center[:, None], rotation[:, None]


MAX_RMS_ERROR = 0.05
"""Relative root mean square error of withheld distances above which a method has failed."""
NORMAL_QUANTILE_95 = 1.959964


@dataclass(frozen=True, eq=False)
class MethodResults:
    """Results of a method for B scenes.

    Attributes
    ----------
    error_m
        (B, m) of the withheld distances; NaN where there is no pose.
    sigma_m
        (B, m) predicted; inf where the pose is undetermined; NaN for methods that predict none.
    true_m
        (B, m) the distances.
    cost
        (B,) sum of squares.
    ambiguous
        (B,) whether the method reports that another pose fits as well.
    """

    error_m: Floats
    sigma_m: Floats
    true_m: Floats
    cost: Floats
    ambiguous: Bools

    @property
    def rms_m(self) -> Floats:
        """(B,) of each scene; inf where there is no pose."""
        return np.asarray(np.nan_to_num(np.sqrt(np.mean(self.error_m**2, axis=1)), nan=np.inf))

    @property
    def failed(self) -> Bools:
        """(B,) whether the distances are useless."""
        return self._are_useless(self.error_m)

    @property
    def told(self) -> Bools:
        """(B,) whether the method reports that: by no pose, by another one, or by its sigmas."""
        said = self.ambiguous | ~np.isfinite(self.error_m).all(axis=1)
        if np.isnan(self.sigma_m).all():  # it predicts none
            return said
        return said | self._are_useless(self.sigma_m)

    def _are_useless(self, off_m: Floats) -> Bools:
        share = np.sqrt(np.mean((off_m / self.true_m) ** 2, axis=1))
        return ~np.asarray(share <= MAX_RMS_ERROR)


def make_row(setting: str, method: str, parts: list[MethodResults]) -> MethodRow:
    """Return the row of one method.

    Parameters
    ----------
    setting, method
        Names.
    parts
        Results, from the scenes with least features to those with most.
    """
    rms = np.concatenate([one.rms_m for one in parts])
    failed = np.concatenate([one.failed for one in parts])
    told = np.concatenate([one.told for one in parts])
    # errors in predicted sigmas, of scenes with a determined pose
    z = np.concatenate([(one.error_m / one.sigma_m).ravel() for one in parts])
    z = z[np.isfinite(z) & np.isfinite(np.concatenate([one.sigma_m.ravel() for one in parts]))]
    return MethodRow(
        setting=setting,
        method=method,
        scenes=len(rms),
        rms_m=float(np.median(rms)),
        ninth_m=float(np.quantile(rms, 0.9, method="inverted_cdf")),
        fewest_m=float(np.median(parts[0].rms_m)),
        most_m=float(np.median(parts[-1].rms_m)),
        failed=float(failed.mean()),
        ambiguous=float(np.concatenate([one.ambiguous for one in parts]).mean()),
        told=float(told.mean()),
        failed_silently=float((failed & ~told).mean()),
        coverage=float(np.mean(np.abs(z) <= NORMAL_QUANTILE_95)) if len(z) else float("nan"),
        z=float(np.sqrt(np.mean(z**2))) if len(z) else float("nan"),
    )


LINES = frozenset({"start on line", "end on line"})
"""Observations of lines of known position."""

MAX_RIVAL_INCREASE = 9.0
"""Largest rise of the sum of squares at which another pose fits as well: three sigma."""

LIMIT_SETTINGS = (
    Setting(name="three lines", features=(3, 3)),
    Setting(name="lines of 1 to 2 m", length_m=(1.0, 2.0)),
    Setting(name="lines parallel to 3 degrees", turn_deg=3.0),
    Setting(name="all in a corner, a third as wide", share=0.33, length_m=(2.0, 6.0)),
    Setting(name="picks to 3 px", pick_px=3.0),
    Setting(name="distortion left out (k1 = -0.05)", bulge=-0.05),
    Setting(name="points 5 cm off the ground", relief_m=0.05),
    Setting(name="straight down, to 5 degrees", tilt_deg=(0.0, 5.0)),
)
"""Settings beyond the usual one, in each of which some method fails."""


def compare_methods(setting: Setting, scenes: int, seed: int = 0) -> list[MethodRow]:
    """Compare all methods in one setting.

    Parameters
    ----------
    setting
        Properties of the scenes.
    scenes
        Total number, divided equally among the numbers of features.
    seed
        Of the draws.
    """
    counts = range(setting.features[0], setting.features[1] + 1)
    each = max(1, scenes // len(counts))
    drawn = [draw_scenes(setting, lines, each, seed) for lines in counts]
    return [
        make_row(setting.name, name, [run_method(method, some) for some in drawn])
        for name, method in METHODS.items()
    ]


class FoundPoses(NamedTuple):
    """Minima of B scenes from S starts each, the lowest first.

    Attributes
    ----------
    center, rotation, covariance
        (B, S, 3), (B, S, 3, 3), (B, S, 6, 6); NaN covariance where the iterations did not converge.
    cost
        (B, S) sums of squares; inf: no pose.
    """

    center: Floats
    rotation: Floats
    covariance: Floats
    cost: Floats


LAST_REDUCTION = 1e-10
"""Expected reduction of the sum of squares by the last step: 1e-5 sigma. Minima that are hardly
determined are not reached more closely."""

FREE_INFORMATION = 1e-5
"""Information [1/m^2, 1/rad^2] on position and heading that lengths alone leave free: it fixes them
without changing a length."""


def find_minima(scenes: MethodScenes, uses: frozenset[str], starts: Starts) -> FoundPoses:
    """Adjust every scene from each of its starts.

    Parameters
    ----------
    scenes
        The scenes.
    uses
        Observations beside the picks: ``start`` (its stated place), ``start on line``, ``end on
        line``, ``length``, ``log``.
    starts
        Initial poses.
    """
    count, many = starts[0].shape[:2]
    owner = np.repeat(np.arange(count), many)
    center, rotation = starts[0].reshape(-1, 3), starts[1].reshape(-1, 3, 3)
    some = np.isfinite(center[:, 0])
    center = np.where(some[:, None], center, [0.0, 0.0, -1.0])  # below ground: no pose
    rotation = np.where(some[:, None, None], rotation, np.diag([1.0, -1.0, -1.0]))
    prior, information = (center, rotation), np.zeros(6)
    if "log" in uses:
        prior = scenes.logged[0][owner], scenes.logged[1][owner]
        information = np.array(LOG_SIGMA) ** -2
    elif uses == {"length"}:
        information = np.full(6, FREE_INFORMATION)
    taped = scenes.length_m.shape[1] if "length" in uses else 0
    end, toward, placed = _list_coordinates(scenes, uses)
    sigma = np.repeat([scenes.length_sigma_m, scenes.place_sigma_m], [taped, len(end)])
    observed = _observe_lengths(scenes, scenes.pixel_px, scenes.length_m[:, :taped])._replace(
        information=np.broadcast_to(np.diag(information), (count, 6, 6)),
        toward=toward,
        placed=np.broadcast_to(end, (count, len(end))),
        reading_m=np.concatenate([scenes.length_m[:, :taped], placed], axis=1),
        reading_weight=np.broadcast_to(1.0 / sigma, (count, len(sigma))),
    )
    photos = observed.take(owner)._replace(center=prior[0], rotation=prior[1])
    exact = SharedErrors(scenes.calibration)
    found = adjust_photos(exact, photos, (center, rotation), undamped=0, settled=LAST_REDUCTION)
    cost = np.nan_to_num(found.cost, nan=np.inf).reshape(count, many)
    order = np.argsort(cost, axis=1, kind="stable")
    at = many * np.arange(count)[:, None] + order
    every = found.center_world_m, found.world_from_camera, found.covariance, cost.ravel()
    return FoundPoses(*(one[at] for one in every))


def _observe_lengths(scenes: MethodScenes, pixel_px: Floats, length_m: Floats) -> Photos:
    """Return picks (B, k, 2, 2) on level ground, lengths (B, l) of the first, and no prior pose."""
    count, lines = length_m.shape
    pixel = pixel_px.reshape(count, -1, 2)
    ends = np.arange(2 * lines).reshape(-1, 2)
    return Photos(
        pixel_px=pixel,
        pixel_weight=np.full(pixel.shape[:2], 1.0 / scenes.pick_sigma_px),
        height_m=np.zeros(pixel.shape[:2]),
        ground=np.zeros((count, 3)),
        center=scenes.center,
        rotation=scenes.rotation,
        information=np.zeros((count, 6, 6)),
        line=np.broadcast_to(ends, (count, *ends.shape)),
        toward=np.zeros((count, 0, 2)),
        placed=np.zeros((count, 0), np.int64),
        reading_m=length_m,
        reading_weight=np.ones(length_m.shape),
    )


def _list_coordinates(scenes: MethodScenes, uses: frozenset[str]) -> tuple[Ints, Floats, Floats]:
    """List coordinates of ends: the ends (P,), directions (B, P, 2), coordinates (B, P)."""
    along = scenes.place_m[:, :, 1] - scenes.place_m[:, :, 0]
    along = along / np.linalg.norm(along, axis=2, keepdims=True)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    stated = {
        "start": [(0, np.array([1.0, 0.0])), (0, np.array([0.0, 1.0]))],
        "start on line": [(0, across)],
        "end on line": [(1, across)],
    }
    end, toward, placed = [np.zeros(0, dtype=np.int64)], [along[:, :0]], [along[:, :0, 0]]
    for which, direction in (one for use, rows in stated.items() if use in uses for one in rows):
        end.append(2 * np.arange(along.shape[1]) + which)
        toward.append(np.broadcast_to(direction, along.shape))
        placed.append(np.sum(direction * scenes.place_m[:, :, which], axis=2))
    return np.concatenate(end), np.concatenate(toward, axis=1), np.concatenate(placed, axis=1)


SAME_DIRECTION_RAD, SAME_RELATIVE_DISTANCE = 0.01, 0.02
"""Differences of direction [rad] and of place, as a share of the camera's height, up to which two
poses are one."""


def compute_rival_differences(found: FoundPoses, within: float) -> Floats:
    """Compute (B,) differences of the next distinct minimum to the best; inf beyond `within`."""
    center, rotation, cost = found.center, found.rotation, found.cost
    height = np.maximum(center[:, :1, 2], 1e-9)
    apart = np.linalg.norm(center - center[:, :1], axis=2) / height
    turn = np.einsum("bij,bsij->bs", rotation[:, 0], rotation)
    other = (apart > SAME_RELATIVE_DISTANCE) | (
        np.arccos(np.clip((turn - 1) / 2, -1, 1)) > SAME_DIRECTION_RAD
    )
    other &= np.isfinite(found.covariance).all(axis=(2, 3))
    with np.errstate(invalid="ignore"):
        worse = np.where(other, cost - cost[:, :1], np.inf)
    least = np.nan_to_num(worse, nan=np.inf).min(axis=1)
    return np.where(least <= within, least, np.inf)


def _judge(scenes: MethodScenes, found: FoundPoses, told: Bools | None = None) -> MethodResults:
    """Compute errors and predicted sigmas of withheld distances with each scene's best pose."""
    poses = found.center[:, 0], found.rotation[:, 0]
    photos = _observe_lengths(scenes, scenes.check_px, scenes.check_m)
    photos = photos._replace(center=poses[0], rotation=poses[1])
    exact = SharedErrors(scenes.calibration)
    place = intersect_ground(scenes.calibration, photos, poses)
    state = State(poses[0], np.zeros_like(poses[0]), place, np.zeros((len(place), 0)))
    # variance by propagation: from the pose, and from the picks of the distance itself
    rows = PhotoProblem(exact, photos).compute_rows(photos, state)
    by_pose = rows.by_unknown
    whole = np.einsum("bmi,bij,bmj->bm", by_pose, found.covariance[:, 0], by_pose)
    whole = np.where(whole >= 0, whole, np.inf)  # negative by rounding: undetermined
    variance = whole + np.sum(rows.by_error**2, axis=(2, 3))
    none = np.where(np.isfinite(found.cost[:, :1]), 0.0, np.nan)
    return MethodResults(
        error_m=none - rows.off,
        sigma_m=np.sqrt(variance) + none,
        true_m=scenes.check_m,
        cost=found.cost[:, 0],
        ambiguous=np.isfinite(compute_rival_differences(found, MAX_RIVAL_INCREASE))
        if told is None
        else told,
    )


class Method(NamedTuple):
    """Observations of the maximum likelihood, and its starts; without any, the first start."""

    uses: frozenset[str]
    find_starts: Callable[[MethodScenes], Starts]


def run_method(method: Method, scenes: MethodScenes) -> MethodResults:
    """Find the poses of scenes by a method, and their errors; without observations no sigmas."""
    starts = method.find_starts(scenes)
    if method.uses:
        return _judge(scenes, find_minima(scenes, method.uses, starts))
    cost = np.where(np.isfinite(starts[0][:, :, 0]), 0.0, np.inf)
    found = FoundPoses(*starts, np.zeros((*cost.shape, 6, 6)), cost)
    judged = _judge(scenes, found, np.zeros(len(cost), dtype=np.bool_))
    return replace(judged, sigma_m=np.full(judged.sigma_m.shape, np.nan))


METHODS: Mapping[str, Method] = {
    "points, IPPE alone": Method(frozenset(), find_point_starts),
    "points": Method(frozenset({"start"}), find_point_starts),
    "lines of known position": Method(LINES, find_line_starts),
    "lines, direct start only": Method(LINES, find_direct_starts),
    # The camera's position and heading stay free.
    "lengths": Method(frozenset({"length"}), find_length_starts),
    "log": Method(frozenset({"log"}), get_log_starts),
    # The thesis's lengths with the log as a prior, as in the whole program.
    "lengths and log": Method(frozenset({"length", "log"}), get_log_starts),
    # Nothing counts twice: the start's position, and the end on its line.
    "all": Method(frozenset({"start", "end on line", "length", "log"}), find_all_starts),
}
"""Methods by name, in the order of tables."""
