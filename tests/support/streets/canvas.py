"""The ground of a rendered street from above: a picture to paint on, and its reduced levels.

Rows run along -t (up is the left of the road), columns along s; (0, 0) is a texel's middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Floats

Grey = NDArray[np.uint8]
Single = NDArray[np.float32]
FINE = 8  # samples of a texel's side where shapes are painted


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """A top view: grey (H, W), s and t of its upper left outer corner, the side of a texel."""

    grey: Grey
    s_m: float
    t_m: float
    texel_m: float

    def texels(self, s: Single, t: Single) -> tuple[Single, Single]:
        """Columns and rows of places."""
        per = np.float32(1 / self.texel_m)
        return (s - np.float32(self.s_m)) * per - np.float32(0.5), (
            np.float32(self.t_m) - t
        ) * per - np.float32(0.5)

    def halved(self) -> Layer:
        """The same at half the resolution."""
        height, width = (n // 2 for n in self.grey.shape)
        half = cv2.resize(
            self.grey[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA
        )
        return Layer(
            grey=np.asarray(half, np.uint8), s_m=self.s_m, t_m=self.t_m, texel_m=2 * self.texel_m
        )


@dataclass(kw_only=True, eq=False)
class Canvas:
    """A layer that is being painted; `busy` are (s, t, radius) of what has its place."""

    layer: Layer
    busy: list[tuple[float, float, float]] = field(default_factory=list)

    def shape(
        self,
        outline: Floats,
        value: Callable[[Floats, Floats], tuple[Floats, Floats]],
    ) -> None:
        """Paint within the bounds of an outline (k, 2), each texel's share exactly to 1/64.

        Parameters
        ----------
        outline
            s and t of the shape's corners, or of a box about it.
        value
            Opacity and grey value of s and t, both (n, m).
        """
        layer, grey = self.layer, self.layer.grey
        low, high = outline.min(axis=0), outline.max(axis=0)
        u0 = max(int((low[0] - layer.s_m) / layer.texel_m) - 1, 0)
        u1 = min(int((high[0] - layer.s_m) / layer.texel_m) + 2, grey.shape[1])
        v0 = max(int((layer.t_m - high[1]) / layer.texel_m) - 1, 0)
        v1 = min(int((layer.t_m - low[1]) / layer.texel_m) + 2, grey.shape[0])
        if u1 <= u0 or v1 <= v0:
            return
        sub = (np.arange(FINE) + 0.5) / FINE
        for v in range(v0, v1, 64):  # in strips, for large shapes
            w = min(v + 64, v1)
            s = layer.s_m + layer.texel_m * (np.arange(u0, u1)[:, None] + sub).ravel()
            t = layer.t_m - layer.texel_m * (np.arange(v, w)[:, None] + sub).ravel()
            opacity, paint = value(s[None, :], t[:, None])
            cells = (w - v, FINE, u1 - u0, FINE)
            share = np.broadcast_to(opacity, (cells[0] * FINE, cells[2] * FINE)).reshape(cells)
            laid = (opacity * paint).reshape(cells).mean(axis=(1, 3))
            below = grey[v:w, u0:u1] * (1 - share.mean(axis=(1, 3)))
            grey[v:w, u0:u1] = np.clip(np.rint(below + laid), 0, 255).astype(np.uint8)

    def rectangle(self, low: tuple[float, float], high: tuple[float, float], grey: float) -> None:
        """Fill a rectangle along the axes."""
        self.shape(
            np.array([low, high]),
            lambda s, t: (
                ((s > low[0]) & (s < high[0]) & (t > low[1]) & (t < high[1])).astype(float),
                np.float64(grey) * np.ones((1, 1)),
            ),
        )

    def disc(self, place: Floats, rings: tuple[tuple[float, float], ...]) -> None:
        """Fill circles about a place: (radius, grey value), the largest first."""

        def value(s: Floats, t: Floats) -> tuple[Floats, Floats]:
            away = (s - place[0]) ** 2 + (t - place[1]) ** 2
            paint = np.zeros(away.shape)
            for radius, grey in rings:
                paint[away < radius**2] = grey
            return (away < rings[0][0] ** 2).astype(float), paint

        radius = rings[0][0]
        self.shape(np.array([place - radius, place + radius]), value)
        self.busy.append((*place.tolist(), radius))

    def pattern(self, place: Floats, turn_rad: float, side_m: float, cells: Grey) -> Floats:
        """Lay a square pattern of cells (n, n) down; gives its corners (4, 2).

        Parameters
        ----------
        place
            s and t of its middle.
        turn_rad
            Of its upper edge, from s towards t.
        side_m
            Of the whole pattern.
        cells
            Grey values; corners in the order upper left, upper right, lower right, lower left.
        """
        c, s_ = np.cos(turn_rad), np.sin(turn_rad)
        axes = np.array([[c, s_], [-s_, c]])  # rows: right and up of the pattern
        half, count = side_m / 2, len(cells)

        def value(s: Floats, t: Floats) -> tuple[Floats, Floats]:
            ds, dt = s - place[0], t - place[1]
            right, up = axes[0, 0] * ds + axes[0, 1] * dt, axes[1, 0] * ds + axes[1, 1] * dt
            u = (right + half) / side_m * count
            v = (half - up) / side_m * count
            inside = (u > 0) & (u < count) & (v > 0) & (v < count)
            row, column = (np.clip(x, 0, count - 1).astype(np.int64) for x in (v, u))
            return inside.astype(float), cells[row, column].astype(float)

        signs = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * half
        corner = place + signs @ axes
        self.shape(corner, value)
        self.busy.append((*place.tolist(), 0.75 * side_m))
        return np.asarray(corner)

    def shade(self, outlines: list[Floats], light: float) -> None:
        """Darken within outlines (k, 2) of one thing, with a soft edge of two texels."""
        layer, grey = self.layer, self.layer.grey
        scale = np.array([1.0, -1.0]) / layer.texel_m
        pixels = [(each - [layer.s_m, layer.t_m]) * scale - 0.5 for each in outlines]
        every = np.concatenate(pixels)
        low = np.maximum(every.min(axis=0).astype(np.int64) - 8, 0)
        high = np.minimum(every.max(axis=0).astype(np.int64) + 9, grey.shape[::-1])
        if (high <= low).any():
            return
        mask = np.zeros((high - low)[::-1], np.uint8)
        for pixel in pixels:
            fixed = np.rint((pixel - low) * 64).astype(np.int32)
            cv2.fillConvexPoly(mask, fixed, [255], cv2.LINE_AA, 6)
        soft = cv2.GaussianBlur(mask, (0, 0), 1.5).astype(np.float32)
        part = grey[low[1] : high[1], low[0] : high[0]]
        part[:] = np.rint(part * (1 - soft * np.float32((1 - light) / 255))).astype(np.uint8)

    def free(self, place: Floats, radius: float) -> bool:
        """Whether nothing has its place within a radius."""
        return all(
            np.hypot(place[0] - s, place[1] - t) > radius + other for s, t, other in self.busy
        )
