"""Methods to find the pose of one photo, compared on the same scenes with the same information."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.first_poses.known_lines import (
    compute_direct_poses,
    compute_rival_differences,
    poses_from_lines,
)
from uavgram.estimation.first_poses.length_poses import LengthFrames, search_frames
from uavgram.estimation.first_poses.pose_problem import (
    FeatureRows,
    LineRows,
    intersect_ground_picks,
    intersect_ground_rays,
)
from uavgram.estimation.solver.batched import Minima, minimise_each
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.geometry.ground.plane_pose import pose_above_plane
from uavgram.imaging.known_point_pose import MIN_POINTS, find_poses_from_points
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.simulation import MethodRow
from uavgram.synthetic.study.method_scenes import MethodScenes, Setting, draw_scenes

Starts = tuple[Floats, Floats]
"""Centres (B, S, 3) and rotations (B, S, 3, 3) of S starts of each scene; NaN: no more."""


def make_line_rows(scenes: MethodScenes) -> LineRows:
    """Return the picks of the scenes' lines, for a first pose."""
    rows = scenes.rows
    count = len(rows.pixel_px)
    ray, by_pixel, _ = back_project_with_jacobian(
        rows.calibration.model, rows.calibration.parameters, rows.pixel_px.reshape(count, -1, 2)
    )
    along = rows.place_m[:, :, 1] - rows.place_m[:, :, 0]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return LineRows(
        ray=ray,
        ray_root=by_pixel[..., :2, :] * rows.pick_sigma_px,
        start_m=rows.place_m.reshape(count, -1, 2),
        along=np.repeat(along, 2, axis=1),
        sigma_m=np.full(ray.shape[:2], rows.place_sigma_m),
    )


def find_line_starts(scenes: MethodScenes) -> Starts:
    """Return the best poses of the search with lines."""
    ends = poses_from_lines(make_line_rows(scenes))
    some = np.isfinite(ends.cost)[..., None]
    return np.where(some, ends.state[0], np.nan), np.where(some[..., None], ends.state[1], np.nan)


def find_point_starts(scenes: MethodScenes) -> Starts:
    """Return both poses of OpenCV's IPPE; it takes four points."""
    rows = scenes.rows
    count = len(rows.pixel_px)
    center, rotation = np.full((count, 2, 3), np.nan), np.full((count, 2, 3, 3), np.nan)
    start = rows.pixel_px[:, :, 0]
    ray, _, _ = back_project_with_jacobian(
        rows.calibration.model, rows.calibration.parameters, start
    )
    place = rows.place_m[:, :, 0]
    world = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=-1)
    for k in range(count if start.shape[1] >= MIN_POINTS else 0):
        found = find_poses_from_points(world[k], ray[k])
        if found is not None:
            some = min(2, len(found[0]))
            center[k, :some], rotation[k, :some] = found[0][:some], found[1][:some]
    return center, rotation


def find_length_starts(scenes: MethodScenes, most: int = 4) -> Starts:
    """Return poses above the planes that explain the lengths, with the origin as foot point."""
    rows = scenes.rows
    count, lines = rows.pixel_px.shape[:2]
    end = np.broadcast_to(np.arange(2 * lines), (count, 2 * lines))
    frames = LengthFrames(
        pixel_px=rows.pixel_px.reshape(count, -1, 2),
        pixel_sigma_px=np.full((count, 2 * lines), rows.pick_sigma_px),
        start=end[:, ::2],
        end=end[:, 1::2],
        length_m=rows.length_m,
        length_sigma_m=np.full(rows.length_m.shape, rows.length_sigma_m),
    )
    center, rotation = np.full((count, most, 3), np.nan), np.full((count, most, 3, 3), np.nan)
    for k, candidates in enumerate(search_frames(rows.calibration, frames)):
        for j, plane in enumerate(candidates.plane[:most]):
            center[k, j], rotation[k, j] = pose_above_plane(plane)
    return center, rotation


def get_log_starts(scenes: MethodScenes) -> Starts:
    """Return the logged poses."""
    return scenes.logged.center[:, None], scenes.logged.rotation[:, None]


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

Starter = Callable[[MethodScenes], Starts]


def compare_methods(
    setting: Setting, scenes: int, seed: int = 0, more: Mapping[str, Starter] | None = None
) -> list[MethodRow]:
    """Compare all methods in one setting.

    Parameters
    ----------
    setting
        Properties of the scenes.
    scenes
        Total number, divided equally among the numbers of features.
    seed
        Of the draws.
    more
        Other starting methods for lines of known position, by name.
    """
    counts = range(setting.features[0], setting.features[1] + 1)
    each = max(1, scenes // len(counts))
    found: dict[str, list[MethodResults]] = {}
    for lines in counts:
        drawn = draw_scenes(setting, lines, each, seed)
        for name, method in METHODS.items():
            found.setdefault(name, []).append(method(drawn))
        for name, starter in (more or {}).items():
            found.setdefault(name, []).append(_by_lines(drawn, starter(drawn)))
    return [make_row(setting.name, name, parts) for name, parts in found.items()]


def find_minima(rows: FeatureRows, starts: Starts) -> Minima:
    """Find minima (B, S, ...) from S starts of each scene, the lowest first; cost inf: none."""
    scenes, count = starts[0].shape[:2]
    owner = np.repeat(np.arange(scenes), count)
    repeated = _select(rows, owner)
    center, rotation = starts[0].reshape(-1, 3), starts[1].reshape(-1, 3, 3)
    point, good = intersect_ground_picks(repeated, center, rotation)
    center = np.where(good[:, None], center, [0.0, 0.0, -1.0])  # below ground: no pose
    rotation = np.where(good[:, None, None], rotation, np.eye(3))
    if rows.held is not None:  # each start fixes its own gauge
        repeated = replace(repeated, held=(center, rotation))
    return minimise_each(repeated, (center, rotation, point)).lowest_first(count)


def _select(rows: FeatureRows, which: Ints) -> FeatureRows:
    logged = rows.logged
    if logged is not None:
        logged = replace(logged, center=logged.center[which], rotation=logged.rotation[which])
    return replace(
        rows,
        pixel_px=rows.pixel_px[which],
        place_m=rows.place_m[which],
        length_m=rows.length_m[which],
        logged=logged,
    )


def _judge(scenes: MethodScenes, ends: Minima, told: Bools | None = None) -> MethodResults:
    """Compute errors and predicted sigmas of withheld distances with each scene's best pose."""
    center, rotation = (part[:, 0] for part in ends.state[:2])
    lens, sigma_px = scenes.rows.calibration, scenes.rows.pick_sigma_px
    # variance by propagation: from the pose, and from the picks of the distance itself
    point, by_pose, by_pixel = intersect_ground_rays(lens, scenes.check_px, center, rotation)
    away = point[:, :, 1] - point[:, :, 0]
    length = np.linalg.norm(away, axis=-1)
    unit = away / length[..., None]
    of_pose = np.einsum("bmi,bmij->bmj", unit, by_pose[:, :, 1] - by_pose[:, :, 0])
    of_picks = np.einsum("bmi,bmeij->bmej", unit, by_pixel) * sigma_px
    solvable = np.isfinite(ends.cost[:, 0])
    normal = np.where(solvable[:, None, None], ends.normal[:, 0], np.eye(6))
    whole = np.einsum("bmi,bij,bmj->bm", of_pose, np.linalg.pinv(normal, hermitian=True), of_pose)
    whole = np.where(whole >= 0, whole, np.inf)  # negative by rounding: undetermined
    variance = whole + np.sum(of_picks**2, axis=(2, 3))
    none = np.where(solvable, 0.0, np.nan)[:, None]
    return MethodResults(
        error_m=length - scenes.check_m + none,
        sigma_m=np.sqrt(variance) + none,
        true_m=scenes.check_m,
        cost=ends.cost[:, 0],
        ambiguous=np.isfinite(compute_rival_differences(ends, MAX_RIVAL_INCREASE))
        if told is None
        else told,
    )


def by_points(scenes: MethodScenes) -> MethodResults:
    """Use the start of every line as a known point: IPPE, then maximum likelihood."""
    return _judge(
        scenes, find_minima(replace(scenes.rows, start_place=True), find_point_starts(scenes))
    )


def by_points_alone(scenes: MethodScenes) -> MethodResults:
    """Use the same points: the best pose of IPPE as it is, without sigmas."""
    center, rotation = find_point_starts(scenes)
    count = len(center)
    cost = np.where(np.isfinite(center[:, :, 0]), 0.0, np.inf)
    nothing = np.full((count, center.shape[1], 6, 6), np.nan)
    nothing[:] = np.eye(6)
    fits = np.isfinite(cost)
    ends = Minima((center, rotation), cost, nothing, fits, np.zeros(fits.shape, dtype=np.int64))
    found = _judge(scenes, ends, np.zeros(count, dtype=np.bool_))
    return replace(found, sigma_m=np.full(found.sigma_m.shape, np.nan))


def by_lines(scenes: MethodScenes) -> MethodResults:
    """Use lines of known position: the direct start and the search, then maximum likelihood."""
    return _by_lines(scenes, find_line_starts(scenes))


def by_lines_directly(scenes: MethodScenes) -> MethodResults:
    """Use lines of known position from the direct linear transformation alone."""
    return _by_lines(scenes, find_direct_starts(scenes))


def by_lengths(scenes: MethodScenes) -> MethodResults:
    """Use the lengths of the lines alone: position and heading of the camera stay free."""
    starts = find_length_starts(scenes)
    rows = replace(scenes.rows, length=True, held=(starts[0][:, 0], starts[1][:, 0]))
    return _judge(scenes, find_minima(rows, starts))


def by_log(scenes: MethodScenes) -> MethodResults:
    """Use the log alone."""
    return _judge(
        scenes, find_minima(replace(scenes.rows, logged=scenes.logged), get_log_starts(scenes))
    )


def by_lengths_and_log(scenes: MethodScenes) -> MethodResults:
    """Use the thesis's lengths with the log as a prior, like this program."""
    rows = replace(scenes.rows, length=True, logged=scenes.logged)
    return _judge(scenes, find_minima(rows, get_log_starts(scenes)))


def by_all(scenes: MethodScenes) -> MethodResults:
    """Use the start's position, the end on its line, length and log; without double counting."""
    rows = replace(
        scenes.rows, start_place=True, end_on_line=True, length=True, logged=scenes.logged
    )
    starts = [find_point_starts(scenes), get_log_starts(scenes)]
    center, rotation = (np.concatenate(part, axis=1) for part in zip(*starts, strict=True))
    return _judge(scenes, find_minima(rows, (center, rotation)))


METHODS: Mapping[str, Callable[[MethodScenes], MethodResults]] = {
    "points, IPPE alone": by_points_alone,
    "points": by_points,
    "lines of known position": by_lines,
    "lines, direct start only": by_lines_directly,
    "lengths": by_lengths,
    "log": by_log,
    "lengths and log": by_lengths_and_log,
    "all": by_all,
}
"""Methods by name, in the order of tables."""


def _by_lines(scenes: MethodScenes, starts: Starts) -> MethodResults:
    rows = replace(scenes.rows, start_on_line=True, end_on_line=True)
    return _judge(scenes, find_minima(rows, starts))
