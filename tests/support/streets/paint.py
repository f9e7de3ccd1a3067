"""The ground of a rendered street: asphalt, footpaths, grass, cracks, stains, markings."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from streets.canvas import Canvas, Grey, Layer, Single
from streets.relief import ROAD_HALF_M
from uavgram.model.arrays import Floats

FOOTPATH_M = 6.5
PAINT, DARK = 205.0, 50.0
DASH_M, DASH_PERIOD_M, LINE_M = 2.0, 5.0, 0.12
STRIPE_M, STRIPE_PERIOD_M, ZEBRA_M = 0.5, 1.0, 3.0
COARSE = 8

# Grey value, contrast of the fine grain and of blotches: asphalt, footpath, grass.
_GROUNDS = ((96.0, 9.0, 7.0), (132.0, 7.0, 5.0), (98.0, 17.0, 12.0))
_COLORS = np.array([[1.03, 1.0, 0.99], [0.97, 1.0, 1.01], [0.62, 1.09, 0.92]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Markings:
    """What was painted: corners of zebra stripes and dashes (k, 2), weak areas (s, s, t, t)."""

    zebra: Floats
    dash: Floats
    weak: tuple[tuple[float, float, float, float], ...]
    zebra_from_m: float


def bare_ground(
    rng: np.random.Generator, half_s_m: float, half_t_m: float, texel_m: float
) -> tuple[Canvas, tuple[tuple[float, float, float, float], ...]]:
    """Asphalt, footpaths and grass with grain, and weak areas of the asphalt.

    Parameters
    ----------
    rng
        Draws the grain.
    half_s_m, half_t_m
        Half sizes of the picture.
    texel_m
        Its resolution.
    """
    shape = (round(2 * half_t_m / texel_m), round(2 * half_s_m / texel_m))
    weak = []
    for _ in range(max(2, round(half_s_m / 12))):
        s, t = rng.uniform(-half_s_m, half_s_m - 5), float(rng.choice([-3.7, 0.3]))
        weak.append((s, s + rng.uniform(3, 7), t, t + 3.4))
    t_m = half_t_m - (np.arange(shape[0]) + 0.5) * texel_m
    kind = np.digitize(np.abs(t_m), [ROAD_HALF_M, FOOTPATH_M])
    level, fine, blotch = (np.array(_GROUNDS)[kind, k].astype(np.float32) for k in range(3))
    blotches = _grain(rng, shape, ((0.25, 0.7), (1.3, 0.6), (6.0, 0.5)), texel_m)
    grey = np.empty(shape, np.uint8)
    patch = [_texels(each, half_s_m, half_t_m, texel_m) for each in weak]
    for row in range(0, shape[0], 512):
        rows = slice(row, min(row + 512, shape[0]))
        size = (rows.stop - row, shape[1])
        grain = _grain(rng, size, ((texel_m, 0.55), (0.03, 0.65), (0.08, 0.55)), texel_m)
        part = grain * fine[rows, None] + blotches[rows] * blotch[rows, None]
        for u0, u1, v0, v1 in patch:
            a, b = max(v0 - row, 0), min(v1 - row, size[0])
            if b > a:
                part[a:b, u0:u1] *= np.float32(0.22)
                part[a:b, u0:u1] -= 22
        grey[rows] = np.clip(part + level[rows, None], 12, 245)
    layer = Layer(grey=grey, s_m=-half_s_m, t_m=half_t_m, texel_m=texel_m)
    return Canvas(layer=layer), tuple(weak)


def _texels(
    area: tuple[float, float, float, float], half_s_m: float, half_t_m: float, texel_m: float
) -> tuple[int, int, int, int]:
    s0, s1, t0, t1 = area
    return (
        max(round((s0 + half_s_m) / texel_m), 0),
        max(round((s1 + half_s_m) / texel_m), 0),
        round((half_t_m - t1) / texel_m),
        round((half_t_m - t0) / texel_m),
    )


def _grain(
    rng: np.random.Generator,
    shape: tuple[int, int],
    sizes: tuple[tuple[float, float], ...],
    texel_m: float,
) -> Single:
    """Sums of smooth noise, each (its grain [m], weight)."""
    total = np.zeros(shape, np.float32)
    for grain_m, weight in sizes:
        grain = max(grain_m / texel_m, 1.0)
        size = (int(shape[0] / grain) + 3, int(shape[1] / grain) + 3)
        noise = rng.standard_normal(size, dtype=np.float32)
        if grain > 1:
            # An affine map, not a resize: the grain is what it says, and begins anywhere.
            shift = rng.uniform(0.5, 1.5, 2)
            matrix = np.array([[1 / grain, 0, shift[0]], [0, 1 / grain, shift[1]]])
            flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
            border = cv2.BORDER_REFLECT
            wide = cv2.warpAffine(noise, matrix, shape[::-1], flags=flags, borderMode=border)
            noise = np.asarray(wide, np.float32)
        cv2.scaleAdd(np.ascontiguousarray(noise[: shape[0], : shape[1]]), weight, total, total)
    return total


def wear(canvas: Canvas, rng: np.random.Generator, half_s_m: float) -> None:
    """Cracks, stains, patches of repair and litter, as people pick them."""
    layer = canvas.layer
    metres = 2 * half_s_m
    for _ in range(round(0.35 * metres)):
        start = np.array([rng.uniform(-half_s_m, half_s_m), rng.uniform(-6, 6)])
        turn = np.cumsum(rng.normal(0, 0.5, rng.integers(15, 60))) + rng.uniform(0, 7)
        path = start + 0.08 * np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]), axis=0)
        pixel = np.column_stack(layer.texels(path[:, 0].astype("f4"), path[:, 1].astype("f4")))
        thick = max(1, round(rng.uniform(0.012, 0.03) / layer.texel_m))
        fixed = np.rint(pixel * 16).astype(np.int32)
        cv2.polylines(
            layer.grey,
            [fixed],
            isClosed=False,
            color=[int(rng.uniform(35, 60))],
            thickness=thick,
            lineType=cv2.LINE_AA,
            shift=4,
        )
    for _ in range(round(1.5 * metres)):  # stains and litter
        place = np.array([rng.uniform(-half_s_m, half_s_m), rng.uniform(-6.4, 6.4)])
        size, grey = rng.uniform(0.03, 0.16, 2), float(rng.choice([45, 60, 150, 175]))
        leaning = float(rng.uniform(0, np.pi))

        def blot(
            s: Floats,
            t: Floats,
            place: Floats = place,
            size: Floats = size,
            grey: float = grey,
            turn: float = leaning,
        ) -> tuple[Floats, Floats]:
            ds, dt = s - place[0], t - place[1]
            a = (np.cos(turn) * ds + np.sin(turn) * dt) / size[0]
            b = (np.cos(turn) * dt - np.sin(turn) * ds) / size[1]
            return 0.8 * np.clip(3 * (1 - a**2 - b**2), 0, 1), np.full((1, 1), grey)

        canvas.shape(np.array([place - size.max(), place + size.max()]), blot)


def markings(canvas: Canvas, rng: np.random.Generator, half_s_m: float) -> tuple[Floats, ...]:
    """Edge lines, dashes and a zebra; gives corners of stripes and of dashes (k, 2), its s."""
    for t in (-ROAD_HALF_M + 0.25, ROAD_HALF_M - 0.25):
        canvas.rectangle((-half_s_m, t - LINE_M / 2), (half_s_m, t + LINE_M / 2), PAINT)
    for t in (-ROAD_HALF_M, ROAD_HALF_M):
        canvas.rectangle((-half_s_m, t - 0.07), (half_s_m, t + 0.07), 118.0)
    zebra_s = float(rng.uniform(-0.5, 0.3) * min(half_s_m, 25))
    canvas.rectangle((zebra_s - 0.3, -3.6), (zebra_s + ZEBRA_M + 0.3, 3.6), 88.0)
    stripes = []
    for k in range(7):  # without wear: one stripe is like the other
        t = -3.25 + k * STRIPE_PERIOD_M
        canvas.rectangle((zebra_s, t), (zebra_s + ZEBRA_M, t + STRIPE_M), PAINT)
        stripes += [(s, y) for s in (zebra_s, zebra_s + ZEBRA_M) for y in (t, t + STRIPE_M)]
    canvas.busy.append((zebra_s + ZEBRA_M / 2, 0.0, 5.0))
    dashes = []
    for s in np.arange(-half_s_m + 1, half_s_m - 3, DASH_PERIOD_M):
        if zebra_s - 3 < s < zebra_s + ZEBRA_M + 1:
            continue
        canvas.rectangle((s, -LINE_M / 2), (s + DASH_M, LINE_M / 2), PAINT)
        dashes += [(x, y) for x in (s, s + DASH_M) for y in (-LINE_M / 2, LINE_M / 2)]
    return np.array(stripes), np.array(dashes), np.array([zebra_s])


def surroundings(rng: np.random.Generator, fine: Layer, beyond_m: float) -> Layer:
    """The same ground farther out, at `COARSE` times the texel."""
    height, width = fine.grey.shape
    half_s, half_t = width * fine.texel_m / 2, height * fine.texel_m / 2
    texel = COARSE * fine.texel_m
    wide = COARSE * (round(beyond_m / texel))  # whole texels of both
    far = wide * fine.texel_m
    canvas, _ = bare_ground(rng, half_s + far, half_t + far, texel)
    layer = Layer(grey=canvas.layer.grey, s_m=-half_s - far, t_m=half_t + far, texel_m=texel)
    for t in (-ROAD_HALF_M + 0.25, ROAD_HALF_M - 0.25):
        Canvas(layer=layer).rectangle(
            (-half_s - far, t - LINE_M / 2), (half_s + far, t + LINE_M / 2), PAINT
        )
    rows, columns = height // COARSE, width // COARSE
    inner = cv2.resize(
        fine.grey[: rows * COARSE, : columns * COARSE],
        (columns, rows),
        interpolation=cv2.INTER_AREA,
    )
    at = wide // COARSE
    layer.grey[at : at + rows, at : at + columns] = inner
    return layer


def tint(t: Single) -> Single:
    """(H, W, 3) colours of a grey value at places across the road."""
    kind = np.digitize(np.abs(t), [ROAD_HALF_M, FOOTPATH_M])
    table = _COLORS / (_COLORS @ [0.114, 0.587, 0.299])[:, None]
    return np.asarray(table.astype(np.float32)[kind])


__all__ = ["Canvas", "Grey", "Layer", "bare_ground", "markings", "surroundings", "tint", "wear"]
