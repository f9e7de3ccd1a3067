"""The height of a rendered street: crown, kerbs, undulation, a bank, a slope.

Street frame: s along the road, t to its left, z up [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Floats

Single = NDArray[np.float32]

KERB_M = 0.12
ROAD_HALF_M = 4.0
CELL_M = 0.1
_CROWN = 0.025
_BANK_M = (10.0, 14.0, 1.5)  # from, to across the road on its right; how high


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """Heights without the kerb on a raster, between whose nodes they are bilinear.

    Attributes
    ----------
    table
        (H, W) heights [m] of nodes `CELL_M` apart: rows along t, columns along s.
    s_m, t_m
        Of the first node.
    """

    table: Single
    s_m: float
    t_m: float

    def smooth(self, s: Single, t: Single) -> Single:
        """Heights without the kerb at (H, W) places, by OpenCV's interpolation (1/32 cell)."""
        u = (s - np.float32(self.s_m)) * np.float32(1 / CELL_M)
        v = (t - np.float32(self.t_m)) * np.float32(1 / CELL_M)
        return np.asarray(
            cv2.remap(self.table, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            np.float32,
        )

    def up(self, place: Floats) -> Floats:
        """(n,) heights of the ground at (n, 2) s and t, bilinear in double precision."""
        place = np.atleast_2d(place)
        at = (place - [self.s_m, self.t_m]) / CELL_M
        height, width = self.table.shape
        at = np.clip(at, 0.0, [width - 1.000001, height - 1.000001])
        whole = at.astype(np.int64)
        du, dv = (at - whole).T
        u, v = whole.T
        table = self.table.astype(np.float64) if self.table.size < 1e5 else self.table
        low = table[v, u] * (1 - du) + table[v, u + 1] * du
        high = table[v + 1, u] * (1 - du) + table[v + 1, u + 1] * du
        kerb = KERB_M * (np.abs(place[:, 1]) > ROAD_HALF_M)
        return np.asarray(low * (1 - dv) + high * dv + kerb, np.float64)


def draw_relief(rng: np.random.Generator, half_s_m: float, half_t_m: float) -> Relief:
    """Draw the ground of a street of the given half sizes."""
    width, height = (round(2 * half / CELL_M) + 1 for half in (half_s_m, half_t_m))
    s = -half_s_m + CELL_M * np.arange(width)
    t = -half_t_m + CELL_M * np.arange(height)
    cells = (int(2 * half_t_m / 7) + 3, int(2 * half_s_m / 7) + 3)
    waves = rng.normal(0, 0.07, cells).astype(np.float32)
    table = cv2.resize(waves, (width, height), interpolation=cv2.INTER_CUBIC)
    start, end, rise = _BANK_M
    bank = np.clip((-t - start) / (end - start), 0, 1)
    across = rise * bank**2 * (3 - 2 * bank)
    across -= _CROWN * np.sqrt(np.minimum(np.abs(t), ROAD_HALF_M) ** 2 + 0.25)
    slope = np.tan(np.deg2rad(rng.normal(0, 0.6, 2)))
    table += (slope[0] * s[None, :] + (slope[1] * t + across)[:, None]).astype(np.float32)
    return Relief(table=np.asarray(table, np.float32), s_m=-half_s_m, t_m=-half_t_m)
