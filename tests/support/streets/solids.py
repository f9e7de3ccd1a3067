"""Things that stand on a rendered street: convex solids, met by rays, casting shadows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import ConvexHull

from uavgram.model.arrays import Bools, Floats, Ints

Color = tuple[float, float, float]
GLASS: Color = (52.0, 46.0, 40.0)
SUNK_M = 0.3  # solids reach below the ground


@dataclass(frozen=True, kw_only=True, eq=False)
class Convex:
    """A convex solid.

    Attributes
    ----------
    vertex
        (n, 3) corners in the street frame [m].
    normal, offset
        (f, 3), (f,): inside where normal . x <= offset.
    color
        (f, 3) BGR of each face.
    contrast
        Grain of its faces, in grey values.
    """

    vertex: Floats
    normal: Floats
    offset: Floats
    color: Floats
    contrast: float

    def span(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats, Ints]:
        """Where rays (n, 3) from origins (n, 3) or (3,) enter and leave, and by which face."""
        speed = ray @ self.normal.T
        gap = self.offset - np.atleast_2d(origin) @ self.normal.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = gap / speed
        entry = np.where(speed < 0, at, -np.inf)
        leave = np.where(speed > 0, at, np.inf)
        entry[(speed == 0) & (gap < 0)] = np.inf
        return entry.max(axis=1), leave.min(axis=1), entry.argmax(axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A car, a house, a wall: solids that belong together, and corners to pick, (k, 3)."""

    kind: str
    solids: tuple[Convex, ...]
    corner: Floats

    def moved(self, by: Floats) -> Body:
        """The same body elsewhere."""
        solids = tuple(
            replace(each, vertex=each.vertex + by, offset=each.offset + each.normal @ by)
            for each in self.solids
        )
        return Body(kind=self.kind, solids=solids, corner=self.corner + by)

    @property
    def vertex(self) -> Floats:
        """(n, 3) of all its solids."""
        return np.concatenate([each.vertex for each in self.solids])


def convex(vertex: Floats, color: Color, contrast: float, *, glass: bool = False) -> Convex:
    """The convex hull of some points; with `glass` all faces but the top are dark."""
    hull = ConvexHull(vertex)
    planes = np.unique(np.round(hull.equations, 6), axis=0)
    faces = np.tile(np.array(color), (len(planes), 1))
    if glass:
        faces[planes[:, 2] < 0.9] = GLASS
    return Convex(
        vertex=vertex, normal=planes[:, :3], offset=-planes[:, 3], color=faces, contrast=contrast
    )


def box(low: Floats, high: Floats, top: tuple[float, float, float, float] | None = None) -> Floats:
    """(8, 3) corners; `top` (s from, s to, t from, t to) where the top is smaller."""
    s0, s1, t0, t1 = top or (low[0], high[0], low[1], high[1])
    below = [(s, t, low[2]) for s in (low[0], high[0]) for t in (low[1], high[1])]
    return np.array([*below, *((s, t, high[2]) for s in (s0, s1) for t in (t0, t1))])


def placed(vertex: Floats, place: Floats, turn_rad: float) -> Floats:
    """Points turned about up and brought to a place (3,)."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.asarray(vertex @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]) + place)


def car(place: Floats, turn_rad: float, color: Color) -> Body:
    """A saloon: a body with bonnet and boot, and a cabin of glass under a roof."""
    body = box(np.array([-2.1, -0.85, -SUNK_M]), np.array([2.1, 0.85, 0.85]))
    cabin = box(np.array([-1.5, -0.8, 0.8]), np.array([1.0, 0.8, 1.45]), (-1.05, 0.35, -0.62, 0.62))
    corner = placed(np.concatenate([body[4:], cabin[4:]]), place, turn_rad)
    solids = (
        convex(placed(body, place, turn_rad), color, 1.5),
        convex(placed(cabin, place, turn_rad), color, 1.5, glass=True),
    )
    return Body(kind="V", solids=solids, corner=corner)


def house(place: Floats, turn_rad: float, height_m: float = 4.5) -> Body:
    """A house with a gable."""
    walls = box(np.array([-4.0, -3.0, -SUNK_M]), np.array([4.0, 3.0, height_m]))
    ridge = np.array([[-4.0, 0, height_m + 2], [4.0, 0, height_m + 2]])
    vertex = placed(np.concatenate([walls, ridge]), place, turn_rad)
    solid = convex(vertex, (70.0, 82.0, 140.0), 14.0)
    faces = solid.color.copy()
    faces[solid.normal[:, 2] > 0.2] = (92.0, 90.0, 96.0)
    return Body(kind="W", solids=(replace(solid, color=faces),), corner=vertex[4:])


def wall(place: Floats, turn_rad: float, length_m: float, width_m: float, high_m: float) -> Body:
    """A garden wall, or a pole."""
    half = np.array([length_m / 2, width_m / 2])
    low, high = np.array([*-half, -SUNK_M]), np.array([*half, high_m])
    vertex = placed(box(low, high), place, turn_rad)
    return Body(kind="W", solids=(convex(vertex, (120.0, 128.0, 134.0), 10.0),), corner=vertex[4:])


def shadow(solid: Convex, ground_m: float, sun: Floats) -> Floats:
    """(k, 2) outline on level ground, (s, t); `sun` points to it."""
    vertex = solid.vertex[solid.vertex[:, 2] > ground_m]
    feet = solid.vertex.copy()
    feet[:, 2] = ground_m
    points = np.concatenate([vertex, feet])
    flat = points[:, :2] - (points[:, 2:] - ground_m) * sun[:2] / sun[2]
    return np.asarray(cv2.convexHull(flat.astype(np.float32))[:, 0], np.float64)


def hidden(point: Floats, center: Floats, bodies: tuple[Body, ...]) -> Bools:
    """(n,) whether something stands between points and centres, both (n, 3)."""
    ray = point - center
    long = np.linalg.norm(ray, axis=1)
    result = np.zeros(len(point), dtype=bool)
    for body in bodies:
        for solid in body.solids:
            entry, leave, _ = solid.span(center, ray)
            within = np.minimum(leave, 1.0) - np.maximum(entry, 0.0)
            result |= within * long > 2e-3
    return result
