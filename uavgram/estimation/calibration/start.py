"""Initial values of a calibration: homographies, Zhang's closed form, poses from rays."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.calibration.adjustment import UndeterminedError, fit_poses
from uavgram.estimation.calibration.problem import Corners, Lens, State, linearise
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import factor_homographies, make_homography_rows, mirror_plane
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import LensModel

MIN_CORNERS = 4
"""Smallest number of corners of a photo that determine its homography."""

FOCAL_GRID = tuple(float(f) for f in np.geomspace(0.2, 5.0, 14))
"""Focal lengths to try, in widths of the image: from a fisheye to a long lens."""


def estimate_first_values(
    lens: Lens,
    corners: Corners,
    size_px: tuple[int, int],
    known: Floats | None = None,
) -> State:
    """Estimate initial camera parameters and board poses for the adjustment.

    Parameters
    ----------
    lens, corners
        Lens to estimate, and the observations; at least four corners in each photo.
    size_px
        Width and height of the image.
    known
        (P,) prior values of the parameters, tried in addition to the others.

    Returns
    -------
    State
        The best fit among the candidates: Zhang's closed form, his equations with the principal
        point in the middle of the image, a grid of focal lengths, the prior values.

    Raises
    ------
    UndeterminedError
        No candidate puts all boards in front of the camera.
    """
    bow = np.zeros(corners.bow.shape[2])
    best, least = None, np.inf
    for parameters in _candidates(lens, corners, size_px, known):
        poses = poses_from_rays(lens.model, parameters, corners)
        if poses is None:
            continue
        state = State(parameters, bow, *poses)
        linear = linearise(lens.hold_fixed(), corners, state)
        cost = np.inf if linear is None else float(np.sum(linear.residual**2))
        if cost < least:
            best, least = state, cost
    if best is None:
        raise UndeterminedError(
            "no focal length explains the photos: the corners are not those of this board, or of "
            "a lens that this model cannot describe"
        )
    return best


def _candidates(
    lens: Lens, corners: Corners, size_px: tuple[int, int], known: Floats | None
) -> list[Floats]:
    """Return candidate parameters (P,) each, consistent with the fixed ones."""
    center = (np.array(size_px) - 1) / 2
    count = len(lens.basis)
    found = [_parameters(count, size_px[0] * f, size_px[0] * f, center) for f in FOCAL_GRID]
    if lens.model == "brown":
        image = (corners.pixel_px - center) / size_px[0]
        homography = estimate_homographies(corners, image, corners.weight > 0)
        for cameras in (solve_zhang(homography), solve_centred(homography)):
            if cameras is not None:
                fx, fy, cx, cy = cameras * size_px[0]
                found.append(_parameters(count, fx, fy, center + np.array([cx, cy])))
    if known is not None:
        found.append(np.asarray(known))
    return [_fix_parameters(lens, parameters, center) for parameters in found]


def _parameters(count: int, fx: float, fy: float, center: Floats) -> Floats:
    parameters = np.zeros(count)
    parameters[:4] = fx, fy, *center
    return parameters


def _fix_parameters(lens: Lens, parameters: Floats, center: Floats) -> Floats:
    """Return parameters with the requested fixed aspect and fixed principal point."""
    held: Bools = np.abs(lens.basis).sum(axis=1) == 0
    parameters = np.where(held, 0.0, parameters)
    parameters[2:4] = np.where(held[2:4], center, parameters[2:4])
    if lens.basis[:2].any(axis=0).sum() == 1:  # fx follows fy
        aspect = lens.basis[0].max()
        parameters[1] = np.sqrt(parameters[0] * parameters[1] / aspect)
        parameters[0] = aspect * parameters[1]
    return parameters


def estimate_homographies(corners: Corners, image: Floats, seen: Bools) -> Floats:
    """Estimate homographies from the boards' planes to an image.

    Parameters
    ----------
    corners
        Corners with their positions on the board.
    image
        (M, n, 2) their positions in the image, in any unit.
    seen
        (M, n) mask of the corners to use.

    Returns
    -------
    (M, 3, 3)
        Direct linear transformation (Hartley and Zisserman 2004, algorithm 4.2), with the sign that
        puts the boards' middles in front of the camera.
    """
    there = np.asarray(seen, np.float64)[..., None]
    count = np.maximum(there.sum(axis=1, keepdims=True), 1.0)
    size = np.abs(corners.board_m[..., :2]).max()
    board = corners.board_m[..., :2] / size
    middle = np.sum(image * there, axis=1, keepdims=True) / count
    spread = np.sqrt(np.sum((image - middle) ** 2 * there, axis=(1, 2), keepdims=True) / count)
    # The eigenvector of the smallest eigenvalue solves the equations in normalised coordinates.
    rows = make_homography_rows(board, (image - middle) / spread, there)
    vectors = np.linalg.eigh(np.swapaxes(rows, 1, 2) @ rows)[1]
    homography = vectors[:, :, 0].reshape(-1, 3, 3)
    back = np.zeros((len(image), 3, 3))
    back[:, :2, :2] = spread * np.eye(2)
    back[:, :2, 2] = middle[:, 0]
    back[:, 2, 2] = 1.0
    homography = back @ homography
    homography[:, :, :2] /= size
    # The board's middle is in front of the camera.
    sign = np.where(homography[:, 2, 2] < 0, -1.0, 1.0)
    return np.asarray(homography * sign[:, None, None])


def _products(homography: Floats, i: int, j: int) -> Floats:
    """Return (M, 5) factors of (B11, B22, B13, B23, B33) in h_i^T B h_j.

    Zhang 2000, eq. 7, with B12 = 0.
    """
    a, b = homography[:, :, i], homography[:, :, j]
    return np.stack(
        [
            a[:, 0] * b[:, 0],
            a[:, 1] * b[:, 1],
            a[:, 2] * b[:, 0] + a[:, 0] * b[:, 2],
            a[:, 2] * b[:, 1] + a[:, 1] * b[:, 2],
            a[:, 2] * b[:, 2],
        ],
        axis=1,
    )


def _constraints(homography: Floats) -> Floats:
    """Return (2 M, 5) rows V with V b = 0: Zhang 2000, eq. 8, without skew."""
    length = np.linalg.norm(homography[:, :, :2], axis=(1, 2))
    homography = homography / length[:, None, None]
    return np.concatenate(
        [
            _products(homography, 0, 1),
            _products(homography, 0, 0) - _products(homography, 1, 1),
        ]
    )


def solve_zhang(homography: Floats) -> Floats | None:
    """Compute fx, fy, cx, cy in the units of the homographies' images; None if not real.

    Z. Zhang 2000, "A flexible new technique for camera calibration", IEEE TPAMI 22(11), sec. 3.1
    and appendix B, with the skew held at zero; needs two tilted photos.
    """
    rows = _constraints(homography)
    if len(rows) < 4:
        return None
    b11, b22, b13, b23, b33 = np.linalg.svd(rows, full_matrices=True)[2][-1].tolist()
    if b11 * b22 <= 0:
        return None
    scale = b33 - b13**2 / b11 - b23**2 / b22
    if scale / b11 <= 0:
        return None
    return np.array([np.sqrt(scale / b11), np.sqrt(scale / b22), -b13 / b11, -b23 / b22])


def solve_centred(homography: Floats) -> Floats | None:
    """Compute fx, fy, 0, 0 from the same equations, with a centred principal point."""
    rows = _constraints(homography)
    inverse = np.linalg.lstsq(rows[:, :2], -rows[:, 4], rcond=None)[0]  # 1 / fx^2, 1 / fy^2
    if inverse.min() <= 0:
        both = rows[:, :2].sum(axis=1)
        inverse = np.full(2, -(both @ rows[:, 4]) / (both @ both))
    if inverse.min() <= 0:
        return None
    return np.array([*(inverse**-0.5), 0.0, 0.0])


def poses_from_rays(
    model: LensModel, parameters: Floats, corners: Corners
) -> tuple[Floats, Floats] | None:
    """Compute poses of the boards from given camera parameters; None if a photo has too few rays.

    Parameters
    ----------
    model, parameters
        Lens model; (P,).
    corners
        Observations of M photos.

    Returns
    -------
    camera_from_board : (M, 3, 3)
    middle_camera_m : (M, 3)
        By factorisation of the homographies (Zhang 2000, sec. 3.1, appendix C).
    """
    ray = back_project(model, parameters, corners.pixel_px)[..., :2]
    there = np.isfinite(ray[..., 0]) & (corners.weight > 0)
    if there.sum(axis=1).min() < MIN_CORNERS:
        return None
    homography = estimate_homographies(corners, np.where(there[..., None], ray, 0.0), there)
    return factor_homographies(homography)


def choose_better_pose(lens: Lens, corners: Corners, state: State) -> State:
    """Replace the pose of each board by its mirrored pose where this fits better.

    Parameters
    ----------
    lens, corners
        The lens (held fixed), and the observations.
    state
        State with a pose of the board in each photo.
    """
    fixed = lens.hold_fixed()
    linear = linearise(fixed, corners, state)
    other, cost = fit_poses(lens, corners, mirror_poses(state))
    if linear is None:
        return state
    better = cost < np.sum(linear.residual**2, axis=1)
    return other.choose_poses(better, state)


def mirror_poses(state: State) -> State:
    """Compute the second pose of each board: its normal mirrored about the line of sight."""
    turned = mirror_plane(state.camera_from_board, state.middle_camera_m)
    return State(state.parameters, state.bow_m, turned, state.middle_camera_m)
