"""Ground points of pixels with their full covariance from pose, lens, ground plane and pixel.

The point on the plane that a pixel shows depends on all parameters of the camera's view. Their
covariance is collected at the pixel, S = G C G^T + S_pixel with G the derivatives of a ground
point's pixel, and carried to the ground by the inverse of the 2x2 derivative H of this pixel by the
point's east and north (implicit function theorem): H^-1 S H^-T.

This is a kernel for programs that compute millions of points of one photo (its rate beside OpenCV
and mrcal: tests/benchmarks/bench_single_frame.py). A survey's own points are few and correlated
with all its unknowns: `estimation/measuring/` propagates them together.

Arrays hold one component each, over a block of points that fits into the processor's cache; 2x2
matrices are inverted in closed form.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.geometry.camera.lens import Distorted, write_parameter_derivative
from uavgram.geometry.camera.projection import rays_and_lens
from uavgram.model.arrays import Floats, freeze
from uavgram.model.camera import LensModel

BLOCK = 8192
"""Points per block; with fewer, the overhead of numpy calls exceeds the arithmetic."""

POSE_SIZE = 6
PLANE_SIZE = 3


@dataclass(frozen=True, eq=False)
class View:
    """Camera over its ground plane, with the joint covariance of both.

    Attributes
    ----------
    model, parameters
        Lens model; (P,) its parameters.
    center_world_m, world_from_camera
        (3,), (3, 3).
    plane, pivot_m
        (3,) height at the pivot [m], slopes east and north; (2,) east and north of the pivot.
    covariance
        (6 + P, 6 + P) of (δcentre in world [m], δθ in camera [rad], parameters), or (9 + P, 9 + P)
        with the plane's three at the end; correlations included.
    """

    model: LensModel
    parameters: Annotated[Floats, "p"]
    center_world_m: Annotated[Floats, 3]
    world_from_camera: Annotated[Floats, 3, 3]
    plane: Annotated[Floats, 3]
    pivot_m: Annotated[Floats, 2]
    covariance: Annotated[Floats, "c", "c"]

    def __post_init__(self) -> None:
        plain = POSE_SIZE + len(self.parameters)
        sizes = (plain, plain + PLANE_SIZE)
        if self.covariance.shape not in {(size, size) for size in sizes}:
            raise ValueError(
                f"covariance: expected {plain} x {plain}, or {plain + PLANE_SIZE} with the plane, "
                f"got {self.covariance.shape}"
            )
        freeze(self)


class GroundPoints(NamedTuple):
    """World points (N, 3) [m], and covariances (N, 2, 2) of east and north [m^2]."""

    point_world_m: Floats
    covariance_m2: Floats


def compute_ground_points(
    view: View,
    pixel_px: Floats,
    pixel_covariance_px2: Floats,
    height_above_m: Floats | float = 0.0,
    *,
    threads: int = 1,
) -> GroundPoints:
    """Compute the ground points of pixels of one image, with covariances.

    Parameters
    ----------
    view
        Camera and ground.
    pixel_px
        (N, 2) in the original, distorted image.
    pixel_covariance_px2
        (2, 2) of every pixel, or (N, 2, 2).
    height_above_m
        Height of the points above the plane: one for all, or (N,).
    threads
        Number of threads, each of which works on blocks of points.

    Returns
    -------
    GroundPoints
        NaN where a pixel has no ray, or its ray does not go down to the plane.
    """
    pixel = np.asarray(pixel_px, np.float64)
    pixel_covariance_px2 = np.asarray(pixel_covariance_px2, np.float64)
    n = len(pixel)
    by_point = pixel_covariance_px2.ndim == 3
    above = np.asarray(height_above_m, np.float64)
    result = GroundPoints(np.empty((n, 3)), np.empty((n, 2, 2)))

    def work(first: int, last: int) -> None:
        scratch = _Scratch(len(view.covariance), min(BLOCK, last - first))
        for start in range(first, last, BLOCK):
            rows = slice(start, min(start + BLOCK, last))
            own_noise = pixel_covariance_px2[rows] if by_point else pixel_covariance_px2
            own_above = above[rows] if above.ndim else above
            point, covariance = result.point_world_m[rows], result.covariance_m2[rows]
            _fill(view, pixel[rows], own_noise, own_above, scratch, GroundPoints(point, covariance))

    # At most as many threads as there are blocks.
    bounds = np.linspace(0, n, max(1, min(threads, -(-n // BLOCK))) + 1).astype(int).tolist()
    if len(bounds) == 2:
        work(0, n)
    else:
        with ThreadPoolExecutor(len(bounds) - 1) as pool:
            list(pool.map(work, bounds[:-1], bounds[1:]))
    return result


class _Scratch:
    """Reused memory of one block: allocating new pages costs more than the arithmetic."""

    def __init__(self, size: int, points: int) -> None:
        self.derivatives = np.empty(2 * size * points)
        self.along = np.empty(size * points)
        self.size = size

    def of(self, points: int) -> tuple[Floats, Floats]:
        """Return views of shapes (2, size, points) and (size, points)."""
        size = self.size * points
        return (
            self.derivatives[: 2 * size].reshape(2, self.size, points),
            self.along[:size].reshape(self.size, points),
        )


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # rays that meet no ground
def _fill(
    view: View,
    pixel: Floats,
    noise: Floats,
    above: Floats,
    scratch: _Scratch,
    out: GroundPoints,
) -> None:
    """Compute the points and covariances of one block."""
    x, y, lens = rays_and_lens(view.model, view.parameters, pixel)
    rotation, plane = view.world_from_camera, view.plane
    east, north, up = (r[0] * x + r[1] * y + r[2] for r in rotation.tolist())
    height, slope_east, slope_north = plane.tolist()
    center_east, center_north, center_up = view.center_world_m.tolist()
    pivot_east, pivot_north = view.pivot_m.tolist()
    level = height + slope_east * (center_east - pivot_east)
    clearance = center_up - level - slope_north * (center_north - pivot_north) - above
    descent = slope_east * east + slope_north * north - up
    # Intersect the rays with the plane.
    distance = clearance / descent
    distance[~((descent > 0) & (distance > 0) & np.isfinite(distance))] = np.nan
    point = out.point_world_m
    np.add(distance * east, center_east, out=point[:, 0])
    np.add(distance * north, center_north, out=point[:, 1])
    np.add(distance * up, center_up, out=point[:, 2])
    nearness = 1.0 / distance  # equal to the inverse depth, as rays have z = 1
    # Covariance at the pixel, then on the ground.
    at_pixel = _PixelDerivatives(view, lens, (x, y, nearness))
    from_pivot = (point[:, 0] - pivot_east, point[:, 1] - pivot_north)
    spread = at_pixel.covariance(view.covariance, from_pivot, scratch)
    if noise.ndim == 2:
        (uu, uv), (_, vv) = noise.tolist()
    else:
        uu, uv, vv = noise[:, 0, 0], noise[:, 0, 1], noise[:, 1, 1]
    at_pixel.to_ground((spread[0] + uu, spread[1] + uv, spread[2] + vv), out.covariance_m2)


class _PixelDerivatives:
    """Derivatives of the pixel (u, v) of points that stay on the ground, over one block."""

    def __init__(self, view: View, lens: Distorted, ray: tuple[Floats, Floats, Floats]) -> None:
        self.view, self.lens = view, lens
        self.x, self.y, nearness = ray
        fx, fy = view.parameters[:2].tolist()
        self.by_x = fx * lens.a, fy * lens.b
        self.by_y = fx * lens.b, fy * lens.c
        self.near_x = tuple(by * nearness for by in self.by_x)
        self.near_y = tuple(by * nearness for by in self.by_y)

    def by_shift(self, direction: Floats) -> tuple[Floats, Floats]:
        """Compute derivatives of (u, v) by a shift [m] along a direction in the camera frame."""
        d0, d1, d2 = direction.tolist()
        shift_x, shift_y = d0 - d2 * self.x, d1 - d2 * self.y
        return (
            self.near_x[0] * shift_x + self.near_y[0] * shift_y,
            self.near_x[1] * shift_x + self.near_y[1] * shift_y,
        )

    def write(self, g: Floats, from_pivot: tuple[Floats, Floats]) -> None:
        """Fill (2, size, N) with derivatives of (u, v) by all parameters in the covariance."""
        view, x, y = self.view, self.x, self.y
        rotation = view.world_from_camera
        count = len(view.parameters)
        for axis in range(3):  # a shift of the centre acts as the opposite shift of the point
            g[0, axis], g[1, axis] = self.by_shift(-rotation[axis])
        # Rotation R exp(a): the ray v changes by v x a, and its (x, y) by the first two components
        # of this, less (x, y) times the third.
        xy, above_x, above_y = x * y, x * x + 1.0, y * y + 1.0
        for row in range(2):
            by_x, by_y = self.by_x[row], self.by_y[row]
            np.add(by_x * xy, by_y * above_y, out=g[row, 3])
            np.add(by_x * above_x, by_y * xy, out=g[row, 4])
            np.negative(g[row, 4], out=g[row, 4])
            np.subtract(by_x * y, by_y * x, out=g[row, 5])
        lens_rows = g[:, POSE_SIZE : POSE_SIZE + count].transpose(2, 0, 1)
        write_parameter_derivative(lens_rows, view.model, view.parameters, self.lens, (x, y))
        # Plane: its height and slopes lift the point along up.
        if g.shape[1] > POSE_SIZE + count:
            for row, rise in enumerate(self.by_shift(rotation[2])):
                g[row, -3] = rise
                np.multiply(rise, from_pivot[0], out=g[row, -2])
                np.multiply(rise, from_pivot[1], out=g[row, -1])

    def covariance(
        self, covariance: Floats, from_pivot: tuple[Floats, Floats], scratch: _Scratch
    ) -> tuple[Floats, Floats, Floats]:
        """Compute the (u u, u v, v v) variances at the pixel."""
        g, along = scratch.of(len(self.x))
        self.write(g, from_pivot)
        np.matmul(covariance, g[0], out=along)
        uu, uv = np.einsum("kn,kn->n", g[0], along), np.einsum("kn,kn->n", g[1], along)
        np.matmul(covariance, g[1], out=along)
        return uu, uv, np.einsum("kn,kn->n", g[1], along)

    def to_ground(self, spread: tuple[Floats, Floats, Floats], out: Floats) -> None:
        """Propagate (u u, u v, v v) to covariances (N, 2, 2) of east and north."""
        rotation, (_, slope_east, slope_north) = self.view.world_from_camera, self.view.plane
        u_e, v_e = self.by_shift(rotation[0] + slope_east * rotation[2])
        u_n, v_n = self.by_shift(rotation[1] + slope_north * rotation[2])
        # Inverse of the 2x2 derivative H of the pixel by east and north; then H^-1 S H^-T.
        over = 1.0 / (u_e * v_n - u_n * v_e)
        e_u, e_v, n_u, n_v = v_n * over, -u_n * over, -v_e * over, u_e * over
        uu, uv, vv = spread
        of_e_u, of_e_v = e_u * uu + e_v * uv, e_u * uv + e_v * vv
        np.add(e_u * of_e_u, e_v * of_e_v, out=out[:, 0, 0])
        np.add(n_u * of_e_u, n_v * of_e_v, out=out[:, 0, 1])
        out[:, 1, 0] = out[:, 0, 1]
        of_n_u, of_n_v = n_u * uu + n_v * uv, n_u * uv + n_v * vv
        np.add(n_u * of_n_u, n_v * of_n_v, out=out[:, 1, 1])
