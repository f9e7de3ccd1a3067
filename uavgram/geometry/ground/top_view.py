"""Top view of the ground: positions of its pixels in the photos, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.camera.projection import back_project_with_jacobian
from uavgram.geometry.geodesy import Origin, enu_from_geodetic, geographic_from_projected
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.ground.row_projection import project_rows, row_poses
from uavgram.geometry.motion.camera_motion import compute_row_share, rotate_vector
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.maps import GroundRaster
from uavgram.model.result.result import Result

Numbers = NDArray[np.floating]

MIN_SINE = 0.17
"""Least sine of the angle between a ray and the ground (10 degrees).

Flatter rays smear a photo's pixel over many metres, so the ground there stays empty.
"""

MAX_OFF_NADIR = float(np.sqrt(1.0 - MIN_SINE**2) / MIN_SINE)
"""Same limit as a tangent from the vertical."""


@dataclass(frozen=True, eq=False)
class View:
    """Photos that a top view is made of, and the ground they show.

    Attributes
    ----------
    result
        Lens, plane, world.
    rows
        (N,) rows of the photos among the result's frames.
    """

    result: Result
    rows: Ints

    @property
    def frame_id(self) -> tuple[str, ...]:
        """(N,) names."""
        return tuple(self.result.frames.frame_id[i] for i in self.rows)

    @property
    def surface(self) -> Floats:
        """(3,) height of the plane at its pivot [m], its slopes east and north."""
        return self.result.plane.surface

    @property
    def origin(self) -> Origin | None:
        """Latitude, longitude and height of the local zero; None where it is unknown."""
        return self.result.world.origin

    @property
    def least_height_m(self) -> float:
        """Height of the lowest camera above the plane."""
        center = self.result.frames.refined.center_world_m[self.rows]
        surface = self.surface
        below = surface[0] + (center[:, :2] - self.result.plane.pivot_m) @ surface[1:]
        return float(np.abs(center[:, 2] - below).min())

    def ground(self, raster: GroundRaster, columns: Floats, rows: Floats) -> Floats:
        """Compute world positions of the raster's pixels on the plane.

        The result has the shape (len(rows), len(columns), 3).

        Parameters
        ----------
        raster
            Raster that gives the positions of pixels.
        columns, rows
            Pixels; fractions are allowed.
        """
        place = raster.centers(columns, rows)
        pivot, surface = self.result.plane.pivot_m, self.surface
        origin = self.origin
        if raster.crs is None or origin is None:
            up = surface[0] + (place - pivot) @ surface[1:]
            return np.concatenate([place, up[..., None]], axis=-1)
        longitude, latitude = geographic_from_projected(place.reshape(-1, 2), raster.crs)
        up = np.full(len(latitude), surface[0])
        for _ in range(2):  # east and north change with the height by parts in ten thousand
            enu = enu_from_geodetic(latitude, longitude, up + origin[2], origin)
            up = surface[0] + (enu[:, :2] - pivot) @ surface[1:]
        return np.concatenate([enu[:, :2], up[:, None]], axis=1).reshape(*place.shape[:2], 3)

    def look(self, index: int, world_m: Floats) -> tuple[Floats, Floats]:
        """Project ground positions into a photo, also beyond its border.

        Parameters
        ----------
        index
            Index into `rows`.
        world_m
            (..., 3).

        Returns
        -------
        pixel : (..., 2)
            NaN where the lens model has no pixel.
        off_nadir : (...)
            Tangent of the angle from the vertical; NaN where the place is not below.
        """
        result, row = self.result, self.rows[index]
        poses = row_poses(result, row)
        pixel = project_rows(result.camera, result.shared.intrinsics.value, poses, world_m)
        from_center = world_m - poses.center
        down = -from_center[..., 2]
        aside = np.hypot(from_center[..., 0], from_center[..., 1])
        return pixel, aside / np.where(down > 0, down, np.nan)

    def shows(self, u_px: Numbers, v_px: Numbers, off_nadir: Numbers) -> Bools:
        """Mark the places (...) that a photo shows, and not at too flat an angle.

        Parameters
        ----------
        u_px, v_px
            (...) pixels of the photo.
        off_nadir
            (...) tangent of the angle from straight down at which the place is seen.
        """
        camera = self.result.camera
        inside = (u_px >= -0.5) & (u_px <= camera.width_px - 0.5)  # NaN compares False
        inside &= (v_px >= -0.5) & (v_px <= camera.height_px - 0.5)
        return np.asarray(inside & (off_nadir < MAX_OFF_NADIR))


@dataclass(frozen=True, eq=False)
class FrameCovariance:
    """Joint covariance of all parameters that place a photo's pixels on the ground.

    Attributes
    ----------
    covariance
        (N, 9 + P, 9 + P) for each photo of a view: its pose (δcentre world, δθ camera), the
        interior orientation (P), and the plane (height, slopes); with `motion`, one more for the
        readout time.
    pixel_sigma_px
        Sigma of a pixel picked in the top view.
    roughness_sigma_m
        Sigma of the ground's departure from the plane.
    motion
        (N, 6) velocity in the world [m/s] and angular rate in camera axes [rad/s], where the
        readout time is uncertain.
    """

    covariance: Floats
    pixel_sigma_px: float
    roughness_sigma_m: float
    motion: Floats | None = None


def compute_place_sigma(view: View, index: int, pixel: Floats, known: FrameCovariance) -> Floats:
    """Compute the standard deviation of ground places that a photo shows.

    Parameters
    ----------
    view, index
        Photo: the view and the photo's index in it.
    pixel
        (n, 2) in the photo.
    known
        Covariances.

    Returns
    -------
    (n,)
        Semi-major axis of the standard ellipse in east and north [m]; NaN where the pixel is, or
        where it does not meet the ground.
    """
    result, row = view.result, view.rows[index]
    lens = result.shared.intrinsics.value
    poses = row_poses(result, row)
    share = compute_row_share(pixel[:, 1], result.camera.height_px)
    center, turn = poses.at(share)
    rotation = poses.rotation @ exp_so3(turn)
    ray, by_pixel, by_lens = back_project_with_jacobian(result.camera.model, lens, pixel)
    _, d_center, d_ray, d_plane = intersect_ground_with_jacobian(
        center,
        (rotation @ ray[..., None])[..., 0],
        view.surface,
        result.plane.pivot_m,
    )
    turned = d_ray @ rotation
    # The world ray of R exp(d) is R (v + d x v), hence -R [v]x d; the row's own turn comes after d.
    by_turn = -d_ray @ poses.rotation @ hat(rotate_vector(turn, ray))
    parts = [d_center, by_turn, turned @ by_lens, d_plane]
    if known.motion is not None:
        velocity, rate = np.split(known.motion[index], 2)
        by_time = d_center @ velocity - (turned @ hat(ray)) @ rate
        parts.append((share[:, None] * by_time)[..., None])
    jacobian = np.concatenate(parts, axis=2)
    planar = jacobian[:, :2]
    # Variance propagation: correlated parameters, the pixel, and the roughness of the ground.
    spread = planar @ known.covariance[index] @ np.swapaxes(planar, 1, 2)
    pointed = (turned @ by_pixel)[:, :2] * known.pixel_sigma_px
    spread += pointed @ np.swapaxes(pointed, 1, 2)
    raised = d_plane[:, :2, :1] * known.roughness_sigma_m  # acts like a higher plane
    spread += raised @ np.swapaxes(raised, 1, 2)
    # Larger eigenvalue of the symmetric 2x2 matrix.
    half = (spread[:, 0, 0] + spread[:, 1, 1]) / 2
    apart = np.hypot((spread[:, 0, 0] - spread[:, 1, 1]) / 2, spread[:, 0, 1])
    return np.asarray(np.sqrt(half + apart))
