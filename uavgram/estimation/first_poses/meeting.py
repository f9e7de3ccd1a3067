"""Where rays from several places meet."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats, Ints


def meeting(
    center: Floats, direction: Floats, sigma_rad: Floats, owner: Ints, count: int
) -> tuple[Floats, Floats]:
    """Where rays meet (K, 3), and the largest sigma of that, as a share of its distance (K,).

    The point nearest to all rays, in sigmas: minimum of the sum of |(I - d d^T)(x - c)|^2 over
    (sigma times the distance)^2, the distances those of the unweighted one. NaN, and infinity,
    where nothing tells it.

    Parameters
    ----------
    center, direction
        (n, 3) where rays begin, and unit vectors along them.
    sigma_rad
        (n,) of the directions.
    owner
        (n,) point of each, below `count`.
    count
        K.
    """
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    onto = np.einsum("nij,nj->ni", across, center)
    weight = np.ones(len(owner))
    met, spread = np.full((count, 3), np.nan), np.full(count, np.inf)
    for _ in range(2):
        normal = _sums(weight[:, None] * across.reshape(-1, 9), owner, count).reshape(-1, 3, 3)
        right = _sums(weight[:, None] * onto, owner, count)
        values = np.linalg.eigvalsh(normal)
        solvable = values[:, 0] > 1e-12 * values[:, 2]
        met[solvable] = np.linalg.solve(normal[solvable], right[solvable, :, None])[..., 0]
        distance = np.linalg.norm(met[owner] - center, axis=1)
        weight = np.nan_to_num(1.0 / np.maximum(sigma_rad * distance, 1e-9) ** 2, nan=1.0)
        mean = np.bincount(owner, distance, count) / np.maximum(np.bincount(owner, None, count), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = 1.0 / np.sqrt(values[:, 0]) / mean
        spread = np.where(solvable & np.isfinite(largest), largest, np.inf)
    return met, spread


def _sums(rows: Floats, owner: Ints, count: int) -> Floats:
    """(count, k) sum of the rows (n, k) of each owner."""
    columns = (np.bincount(owner, column, count) for column in rows.T)
    return np.stack(list(columns), axis=1)
