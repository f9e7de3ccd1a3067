"""Statistics for experts: orientations, their correlations, and residuals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import POSE_NAMES, Result
from uavgram.views.formatting import number
from uavgram.views.result_tables import Source, select_most_doubtful
from uavgram.views.survey.outlines import flight_order
from uavgram.views.tables import Table, make_table

MAX_POSES, MAX_MATRICES = 120, 16
"""Largest numbers of printed poses and of their matrices; results.json has them all."""

TO_PHOTO_AXES = np.diag([1.0, -1.0, -1.0])
"""Rotation from right, down, forward to photogrammetry's right, up, back."""


SHORT = {
    "plane height": "plane",
    "slope east": "slope E",
    "slope north": "slope N",
    "readout time": "readout",
}
"""Column heads of parameters whose name is long."""


class Matrix(NamedTuple):
    """Correlations: a title, names of the parameters, and rows of correlations with them."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]

    @property
    def heads(self) -> tuple[str, ...]:
        """Short names of the columns."""
        return tuple(SHORT.get(name, name) for name in self.columns)


class Annex(NamedTuple):
    """Content of the annex.

    Attributes
    ----------
    poses, poses_more
        Adjusted photos, and the number of those not shown.
    pairs, correlations
        Names of the columns of correlations within a pose, and these by photo.
    shared, matrices, matrices_more
        Correlations among the shared parameters; of each pose with them; number not shown.
    residuals, residuals_more
        Residuals by photo, the largest ones of many; number not shown.
    """

    poses: Table
    poses_more: int
    pairs: tuple[str, ...]
    correlations: tuple[tuple[str, tuple[str, ...]], ...]
    shared: Matrix | None
    matrices: tuple[Matrix, ...]
    matrices_more: int
    residuals: Table
    residuals_more: int


def lay_out_annex(result: Result) -> Annex:
    """Lay out the annex, photos in the order of flight."""
    order = [int(f) for f in flight_order(result) if result.has_refined[f]]
    shared, matrices, more = _matrices(result, order)
    rows = _rows_by_photo(result)
    size = np.linalg.norm(result.picks.residual_px, axis=1)
    largest = np.array([size[rows[frame]].max(initial=-1.0) for frame in order])
    shown = [order[k] for k in select_most_doubtful(largest)]
    short = ("E", "N", "U", "x", "y", "z")
    upper = zip(*np.triu_indices(6, 1), strict=True)
    return Annex(
        poses=_list_poses(result, order[:MAX_POSES]),
        poses_more=len(order[MAX_POSES:]),
        pairs=tuple(f"{short[i]}{short[j]}" for i, j in upper),
        correlations=tuple(_correlate(result, frame) for frame in order[:MAX_POSES]),
        shared=shared,
        matrices=matrices,
        matrices_more=more,
        residuals=make_table(
            "photo | >picks used | >rms right [px] | >rms down [px] | >largest [px] | of point",
            (_residuals(result, frame, rows[frame]) for frame in shown),
        ),
        residuals_more=len(order) - len(shown),
    )


def omega_phi_kappa_deg(world_from_camera: Floats) -> Floats:
    """Compute the (3,) angles that turn photo axes (right, up, back) into east, north, up.

    R = Rx(omega) Ry(phi) Rz(kappa): Luhmann et al., Close-Range Photogrammetry, 2.2.2.

    Parameters
    ----------
    world_from_camera
        (3, 3) of axes right, down, forward.
    """
    turn = world_from_camera @ TO_PHOTO_AXES
    # R[0,2] = sin(phi); R[1,2] / R[2,2] = -tan(omega); R[0,1] / R[0,0] = -tan(kappa)
    omega = np.arctan2(-turn[1, 2], turn[2, 2])
    phi = np.arcsin(np.clip(turn[0, 2], -1.0, 1.0))
    kappa = np.arctan2(-turn[0, 1], turn[0, 0])
    return np.asarray(np.degrees([omega, phi, kappa]), dtype=np.float64)


def _list_poses(result: Result, order: list[int]) -> Table:
    """Return centre, rotation and sigmas of photos; the sigmas of rotation are about their axes."""
    source, poses, rows = Source(result), result.frames.refined, []
    for frame in order:
        sigma = np.sqrt(np.diagonal(poses.covariance[frame]))
        angles_deg = omega_phi_kappa_deg(poses.world_from_camera[frame])
        rows.append(
            (
                result.frames.frame_id[frame],
                *map(source.length_with_sigma, poses.center_world_m[frame], sigma[:3]),
                *map(number, (*angles_deg, *np.degrees(sigma[3:]))),
            )
        )
    return make_table(
        "photo | >east [m] | >north [m] | >up [m] | >omega [°] | >phi [°] | >kappa [°] | "
        ">sigma x [°] | >sigma y [°] | >sigma z [°]",
        rows,
        source.units,
    )


def _correlate(result: Result, frame: int) -> tuple[str, tuple[str, ...]]:
    """Return the name of a photo, and the correlations within its pose."""
    covariance = result.frames.refined.covariance[frame]
    sigma = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    return result.frames.frame_id[frame], _numbers(correlation[np.triu_indices(6, 1)])


def _numbers(values: Floats) -> tuple[str, ...]:
    return tuple(number(float(value), 2) for value in values)


def _matrices(result: Result, order: list[int]) -> tuple[Matrix | None, tuple[Matrix, ...], int]:
    """Return the shared parameters' matrix, those of photos with it, and the number left out."""
    known = result.orientation
    if known is None:
        return None, (), 0
    names = known.parameters
    shared = Matrix(
        "",
        names,
        tuple((name, _numbers(row)) for name, row in zip(names, known.shared, strict=True)),
    )
    at = {name: k for k, name in enumerate(known.frame_id)}
    every = [name for frame in order if (name := result.frames.frame_id[frame]) in at]
    titles = every[:MAX_MATRICES]
    matrices = tuple(
        Matrix(
            title,
            names,
            tuple(
                (name, _numbers(row))
                for name, row in zip(POSE_NAMES, known.with_pose[at[title]], strict=True)
            ),
        )
        for title in titles
    )
    return shared, matrices, len(every) - len(titles)


def _rows_by_photo(result: Result) -> list[list[int]]:
    """Return the rows of the used picks of each photo."""
    at = {name: k for k, name in enumerate(result.frames.frame_id)}
    rows: list[list[int]] = [[] for _ in at]
    for i, (image, status) in enumerate(zip(result.picks.image, result.picks.status, strict=True)):
        if status in ("used", "suspect"):
            rows[at[image]].append(i)
    return rows


def _residuals(result: Result, frame: int, rows: list[int]) -> tuple[str, ...]:
    picks, name = result.picks, result.frames.frame_id[frame]
    if not rows:
        return (name, "0", "–", "–", "–", "–")
    residual = picks.residual_px[rows]
    rms = np.sqrt(np.mean(residual**2, axis=0))
    size = np.linalg.norm(residual, axis=1)
    worst = int(np.argmax(size))
    sizes = (number(float(one), 2) for one in (*rms, size[worst]))
    return (name, str(len(rows)), *sizes, picks.label[rows[worst]])
