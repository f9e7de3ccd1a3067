"""Results of long flights: as many frames and points as one asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey
from pyproj.enums import TransformDirection
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from uavgram.geometry.camera.projection import project
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import (
    FrameStatus,
    PickResults,
    PickStatus,
    PlanarUncertainty,
    PointResults,
    PoseTable,
)

REFINED: FrameStatus = "refined"
USED: PickStatus = "used"
WIDTH_PX, HEIGHT_PX = 5472, 3648
LENS = np.array([3650.0, 3652.0, 2735.0, 1822.0, -0.06, 0.03, 2e-4, -2e-4, -0.01])
HEIGHT_M, SPACING_M = 60.0, np.array([18.0, 12.0])
NADIR = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
FRAMES_PER_POINT = 5


def large_result(frames: int, points: int, folder: str = "photos") -> Result:
    """A block of strips over level ground, every photo of 20 megapixels; no number is adjusted."""
    rng = np.random.default_rng(3)
    small = synthetic_survey.build(frame_count=20, clean=True)
    side = int(np.ceil(np.sqrt(frames)))
    grid = np.stack(np.divmod(np.arange(frames), side), axis=-1).astype(float)
    grid[:, 1] = np.where(grid[:, 0] % 2, side - 1 - grid[:, 1], grid[:, 1])
    center = np.column_stack([grid * SPACING_M, np.full(frames, HEIGHT_M)])
    center += rng.normal(0, 0.5, center.shape)
    turns = Rotation.from_rotvec(rng.normal(0, 0.03, (frames, 3))).as_matrix()
    refined = _poses(center, NADIR @ turns, np.array([0.1, 0.1, 0.1, 2e-3, 2e-3, 2e-3]))
    off = Rotation.from_rotvec(rng.normal(0, 0.02, (frames, 3))).as_matrix()
    seed = _poses(
        center + rng.normal([1.0, -0.7, 1.4], 0.4, center.shape),
        NADIR @ turns @ off,
        np.array([1.5, 1.5, 2.0, 0.02, 0.02, 0.04]),
    )
    names = tuple(f"DJI_{i:05d}.JPG" for i in range(frames))
    spots = np.zeros((points, 3))
    spots[:, :2] = rng.uniform(0, grid.max(0) * SPACING_M, (points, 2))
    labels = tuple(f"G{k}" for k in range(points))
    picks = _picks(names, center, NADIR @ turns, labels, spots, rng)
    old = dict(zip(small.points.label, labels, strict=False))
    return replace(
        small,
        camera=replace(small.camera, width_px=WIDTH_PX, height_px=HEIGHT_PX, parameters=LENS),
        shared=replace(small.shared, intrinsics=replace(small.shared.intrinsics, value=LENS)),
        frames=replace(
            small.frames,
            frame_id=names,
            path=tuple(f"{folder}/{name}" for name in names),
            time_utc_s=synthetic_survey.START_UTC_S + 2.0 * np.arange(frames, dtype=float),
            status=(REFINED,) * frames,
            reason=("",) * frames,
            seed=seed,
            refined=refined,
            sweep=np.zeros((frames, 6)),
            ties=np.zeros(frames, dtype=np.int64),
            ties_rms_px=np.full(frames, np.nan),
        ),
        points=_points(labels, spots, names, rng),
        picks=picks,
        lines=replace(
            small.lines,
            start=tuple(old[n] for n in small.lines.start),
            end=tuple(old[n] for n in small.lines.end),
        ),
        measurements=replace(
            small.measurements,
            points=tuple(tuple(old[n] for n in row) for row in small.measurements.points),
        ),
    )


def _poses(center: Floats, rotation: Floats, sigma: Floats) -> PoseTable:
    covariance = np.tile(np.diag(sigma**2), (len(center), 1, 1))
    return PoseTable(center_world_m=center, world_from_camera=rotation, covariance=covariance)


def _picks(
    names: tuple[str, ...],
    center: Floats,
    rotation: Floats,
    labels: tuple[str, ...],
    spots: Floats,
    rng: np.random.Generator,
) -> PickResults:
    count = min(FRAMES_PER_POINT, len(names))
    nearest = cKDTree(center[:, :2]).query(spots[:, :2], k=count)[1].reshape(len(spots), count)
    frame, label = nearest.ravel(), np.repeat(np.arange(len(spots)), count)
    camera = np.einsum("nji,nj->ni", rotation[frame], spots[label] - center[frame])
    pixel = project("brown", LENS, camera)
    inside = ((pixel > 5) & (pixel < [WIDTH_PX - 6, HEIGHT_PX - 6])).all(axis=1)
    frame, label, pixel = frame[inside], label[inside], pixel[inside]
    residual = rng.normal(0, 0.7, pixel.shape)
    return PickResults(
        image=tuple(names[i] for i in frame),
        label=tuple(labels[k] for k in label),
        pixel_px=pixel - residual,
        sigma_px=np.full(len(pixel), 0.7),
        residual_px=residual,
        w=residual[:, 0] / 0.7,
        redundancy=np.full(len(pixel), 0.6),
        status=(USED,) * len(pixel),
    )


def _points(
    labels: tuple[str, ...], spots: Floats, names: tuple[str, ...], rng: np.random.Generator
) -> PointResults:
    count = len(spots)
    axes = np.sort(rng.uniform(0.01, 0.06, (count, 2)), axis=1)[:, ::-1]
    covariance = np.tile(np.diag([1e-4, 2e-4]), (count, 1, 1))
    azimuth = rng.uniform(0, np.pi, count)
    longitude, latitude, _ = synthetic_survey.TO_EARTH.transform(
        spots[:, 0], spots[:, 1], spots[:, 2], direction=TransformDirection.INVERSE
    )
    return PointResults(
        label=labels,
        position_world_m=spots,
        covariance_m2=covariance,
        ellipse_95_m=axes,
        ellipse_azimuth_rad=azimuth,
        relative=PlanarUncertainty(
            covariance_m2=covariance, ellipse_95_m=axes, ellipse_azimuth_rad=azimuth
        ),
        departure_m=np.zeros(count),
        departure_sigma_m=np.zeros(count),
        height_above_ground_m=np.zeros(count),
        height_sigma_m=np.zeros(count),
        height_source=tuple("ground" for _ in labels),
        covariance_m3=np.zeros((count, 3, 3)),
        latitude_deg=latitude,
        longitude_deg=longitude,
        frames=((names[0],),) * count,
    )
