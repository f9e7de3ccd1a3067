"""Photos of a rendered street: rays into its ground and its things, blur, noise, JPEG.

The ground is sampled twice a pixel and direction from levels of its top view, things three times;
rows of a rolling shutter have poses of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from streets.canvas import Layer, Single
from streets.flight import Camera, View
from streets.paint import tint
from streets.relief import KERB_M, ROAD_HALF_M, Relief
from streets.solids import Body, Convex, shadow
from uavgram.model.arrays import Floats

SOLID = 3  # samples of a pixel's side on things
STEPS = 4  # secant steps to the ground
SHADE = 0.5
Picture = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """What is to be seen: levels of the top view, finest first, heights, things, the sun."""

    levels: tuple[Layer, ...]
    relief: Relief
    bodies: tuple[Body, ...]
    sun: Floats
    skin: Single


@dataclass(frozen=True, kw_only=True)
class Look:
    """What the camera makes of the light: blur [px], gain, noise (grey values)."""

    blur_px: float = 0.7
    gain: float = 1.0
    noise: float = 1.5


class Renderer:
    """Renders photos of one camera."""

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self.scene, self.camera = scene, camera
        self._plain = camera.plain().astype(np.float32)

    def photo(
        self, view: View, look: Look, movers: tuple[Body, ...], seed: int
    ) -> NDArray[np.uint8]:
        """(H, W, 3) BGR.

        Parameters
        ----------
        view
            Where from.
        look
            Blur, gain and noise.
        movers
            Bodies that are there in this photo only.
        seed
            Of the noise.
        """
        picture, _ = self.clear(view, movers)
        if look.blur_px:
            picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), look.blur_px), np.float32)
        picture *= np.float32(look.gain)
        rng = np.random.default_rng(seed)
        if look.noise:
            # The same in all colours, mostly: what JPEG leaves of it.
            noise = rng.standard_normal(picture.shape[:2], dtype=np.float32)
            picture += (np.float32(look.noise) * noise)[..., None]
        return np.asarray(np.clip(np.rint(picture), 0, 255).astype(np.uint8))

    def clear(self, view: View, movers: tuple[Body, ...] = ()) -> tuple[Picture, Single]:
        """(H, W, 3) without blur and noise, and the depth along the rays (H, W) of the ground."""
        s, t, depth = self._ground(view)
        grey = self._sampled(s, t)
        picture = tint(t) * grey[..., None]
        for body in movers:
            self._shaded(picture, body, view)
        bodies = [*self.scene.bodies, *movers]
        away = [float(np.linalg.norm(b.corner.mean(axis=0) - view.center)) for b in bodies]
        for k in np.argsort(away)[::-1]:
            self._draw(picture, depth, bodies[k], view)
        return picture, depth

    def _rays(self, view: View) -> tuple[tuple[Single, Single, Single], tuple[Single, ...]]:
        """Directions (H, W) of all pixels, one array a coordinate, and centres (H, 1)."""
        center, rotation = view.poses(np.arange(float(self.camera.height_px)))
        r = rotation.astype(np.float32)[:, None]
        x, y = self._plain[..., 0], self._plain[..., 1]
        ray = tuple(r[..., k, 0] * x + r[..., k, 1] * y + r[..., k, 2] for k in range(3))
        base = tuple(np.asarray(c, np.float32)[:, None] for c in center.T)
        return (ray[0], ray[1], np.minimum(ray[2], np.float32(-0.05))), base

    def _ground(self, view: View) -> tuple[Single, Single, Single]:
        """Where the rays meet the ground, (H, W) each: s, t, depth."""
        ray, base = self._rays(view)
        high = self._surface(ray, base, KERB_M)
        low = self._surface(ray, base, 0.0)
        half = np.float32(ROAD_HALF_M)
        raised = np.abs(high[1]) > half
        s, t, depth = (np.where(raised, h, g) for h, g in zip(high, low, strict=True))
        face = ~raised & (np.abs(t) > half)  # the kerb's own face
        t[face] = np.clip(t[face], -half, half)
        return s, t, depth

    def _surface(
        self, ray: tuple[Single, Single, Single], base: tuple[Single, ...], lift_m: float
    ) -> tuple[Single, Single, Single]:
        """Where the rays meet the smooth ground lifted by so much."""
        up = self.scene.relief.smooth
        depth = (np.float32(lift_m) - base[2]) / ray[2]
        before: Single | None = None
        gap_before = depth
        for _ in range(STEPS):
            s, t = base[0] + depth * ray[0], base[1] + depth * ray[1]
            gap = base[2] + depth * ray[2] - up(s, t) - np.float32(lift_m)
            slope = ray[2]
            if before is not None:
                run = depth - before
                small = np.abs(run) < 1e-4
                secant = (gap - gap_before) / np.where(small, 1, run)
                # Of a ray that goes down against the ground; else the plain step.
                slope = np.where(small | (secant > 0.4 * ray[2]), ray[2], secant)
            before, gap_before = depth, gap
            depth = depth - gap / slope
        return base[0] + depth * ray[0], base[1] + depth * ray[1], np.asarray(depth, np.float32)

    def _sampled(self, s: Single, t: Single) -> Single:
        """(H, W) grey values of the ground, from the levels that fit each pixel's footprint."""
        size = (2 * s.shape[1], 2 * s.shape[0])
        wide, tall = (cv2.resize(a, size, interpolation=cv2.INTER_LINEAR) for a in (s, t))
        want = np.repeat(self._wanted(s, t), 2)
        levels = self.scene.levels
        first, far = levels[0], levels[-1]
        half_s, half_t = abs(first.s_m) - 0.1, first.t_m - 0.1
        outside = (np.abs(wide) > half_s) | (np.abs(tall) > half_t)
        result = np.empty(size[::-1], np.float32)
        for row in range(0, size[1], 200):
            part = slice(row, row + 200)
            a, b = (np.asarray(each[part], np.float32) for each in (wide, tall))
            w = want[part]
            near = np.zeros(a.shape, np.float32)
            for k, level in enumerate(levels):
                weight = np.clip(1 - np.abs(w - k), 0, 1).astype(np.float32)[:, None]
                if weight.any():
                    near += weight * _taken(level, a, b)
            out = outside[part]
            result[part] = np.where(out, _taken(far, a, b), near) if out.any() else near
        return np.asarray(cv2.resize(result, s.shape[::-1], interpolation=cv2.INTER_AREA), "f4")

    def _wanted(self, s: Single, t: Single) -> Floats:
        """(H,) level of each row, that its samples are about as far apart as its texels."""
        middle = slice(s.shape[1] // 4, None, max(s.shape[1] // 4, 1))
        ds, dt = (np.diff(a[:, middle], axis=0, append=a[-1:, middle]) for a in (s, t))
        across = np.diff(s, axis=1)[:, middle], np.diff(t, axis=1)[:, middle]
        n = min(ds.shape[1], across[0].shape[1])
        area = np.abs(ds[:, :n] * across[1][:, :n] - dt[:, :n] * across[0][:, :n])
        side = np.sqrt(np.median(area, axis=1)) / 2
        side[-1] = side[-2]
        level = np.log2(np.maximum(side, 1e-6) / self.scene.levels[0].texel_m)
        smooth = cv2.blur(level.reshape(-1, 1), (1, 41)).ravel()
        return np.asarray(np.clip(smooth, 0, len(self.scene.levels) - 1))

    def _shaded(self, picture: Picture, body: Body, view: View) -> None:
        """The shadow of a body that the top view does not have."""
        ground = float(self.scene.relief.up(body.corner[:, :2].mean(axis=0))[0])
        mask = np.zeros(picture.shape[:2], np.uint8)
        for solid in body.solids:
            outline = shadow(solid, ground, self.scene.sun)
            steps = np.linspace(0, 1, 10)[:-1, None]
            ends = zip(outline, np.roll(outline, -1, 0), strict=True)
            path = np.concatenate([a + steps * (b - a) for a, b in ends])
            pixel = view.pixels(np.column_stack([path, self.scene.relief.up(path)]))
            if np.isnan(pixel).any():
                continue
            fixed = np.rint(np.clip(pixel, -1e4, 1e4) * 64).astype(np.int32)
            cv2.fillPoly(mask, [fixed], [255], cv2.LINE_AA, 6)
        if mask.any():
            picture *= (1 - mask.astype(np.float32) * np.float32((1 - SHADE) / 255))[..., None]

    def _draw(self, picture: Picture, depth: Single, body: Body, view: View) -> None:
        """Draw a body over the picture, where the ground is not before it."""
        pixel = view.pixels(body.vertex)
        if np.isnan(pixel).any():
            return
        size = np.array([self.camera.width_px, self.camera.height_px])
        low = np.clip(np.floor(pixel.min(axis=0)).astype(np.int64) - 2, 0, size)
        high = np.clip(np.ceil(pixel.max(axis=0)).astype(np.int64) + 3, 0, size)
        if (high - low < 2).any():
            return
        for row in range(low[1], high[1], 100):
            part = np.s_[row : min(row + 100, high[1]), low[0] : high[0]]
            self._draw_part(picture, depth, (body, part), view)

    def _draw_part(
        self,
        picture: Picture,
        depth: Single,
        what: tuple[Body, tuple[slice, slice]],
        view: View,
    ) -> None:
        body, part = what
        rows, columns = part
        h, w = rows.stop - rows.start, columns.stop - columns.start
        v, u = np.divmod(np.arange(float(SOLID * h * SOLID * w)), SOLID * w)
        offset = (np.column_stack([u, v]) + 0.5) / SOLID - 0.5
        plain = _between(self._plain[part], offset)
        row = rows.start + offset[:, 1]
        keys, which = np.unique(row, return_inverse=True)
        center, rotation = (each[which] for each in view.poses(keys))
        ray = np.einsum("nij,nj->ni", rotation, np.column_stack([plain, np.ones(len(plain))]))
        ground = _between(depth[part][..., None], offset)[:, 0]
        nearest = ground + 1e-3
        color = np.zeros((len(ray), 3))
        hit = np.zeros(len(ray), dtype=bool)
        for solid in body.solids:
            entry, leave, face = solid.span(center, ray)
            mine = (entry < leave) & (entry > 0) & (entry < nearest)
            nearest = np.where(mine, entry, nearest)
            if mine.any():
                place = center[mine] + entry[mine, None] * ray[mine]
                color[mine] = self._shine(solid, face[mine], place)
            hit |= mine
        share = hit.reshape(h, SOLID, w, SOLID).mean(axis=(1, 3))[..., None]
        mean = (color * hit[:, None]).reshape(h, SOLID, w, SOLID, 3).mean(axis=(1, 3))
        picture[part] = picture[part] * (1 - share) + mean

    def _shine(self, solid: Convex, face: NDArray[np.int64], place: Floats) -> Floats:
        """(n, 3) colours of places on the faces of a solid."""
        light = 0.45 + 0.65 * np.clip(solid.normal @ self.scene.sun, 0, 1)
        size = self.scene.skin.shape[0]
        # Two coordinates that run along any face.
        normal = np.abs(solid.normal[face])
        flat = normal[:, 2] > 0.7
        along = np.where(normal[:, 0] > normal[:, 1], place[:, 1], place[:, 0])
        u = np.where(flat, place[:, 0], along) * 100
        v = np.where(flat, place[:, 1], place[:, 2]) * 100
        grain = self.scene.skin[v.astype(np.int64) % size, u.astype(np.int64) % size]
        grey = solid.color[face] + solid.contrast * grain[:, None]
        return np.asarray(grey * light[face, None])


def _taken(level: Layer, s: Single, t: Single) -> Single:
    u, v = level.texels(s, t)
    return np.asarray(
        cv2.remap(level.grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT), np.float32
    )


def _between(image: NDArray[np.float32], offset: Floats) -> Floats:
    """Values (n, c) of an image (H, W, c) at (n, 2) columns and rows, linear, also beyond."""
    h, w = image.shape[:2]
    u0 = np.clip(np.floor(offset[:, 0]).astype(np.int64), 0, max(w - 2, 0))
    v0 = np.clip(np.floor(offset[:, 1]).astype(np.int64), 0, max(h - 2, 0))
    u1, v1 = np.minimum(u0 + 1, w - 1), np.minimum(v0 + 1, h - 1)
    du, dv = (offset - np.column_stack([u0, v0])).T[..., None]
    above = image[v0, u0] * (1 - du) + image[v0, u1] * du
    below = image[v1, u0] * (1 - du) + image[v1, u1] * du
    return np.asarray(above * (1 - dv) + below * dv, np.float64)
