"""Flights over ground of which only tie points are known: true poses and sightings of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.first_poses.tied.bundle import TiedPoses, TiedRays
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Bools, Floats

FOCAL_PX = 2800.0
HALF_PX = np.array([2000.0, 1500.0])


@dataclass(frozen=True, eq=False)
class TiedFlight:
    """The truth, and what is seen of it.

    Attributes
    ----------
    center, rotation
        (F, 3), (F, 3, 3) world from camera.
    point
        (T, 3).
    sightings
        With noise, some of them wrong.
    wrong
        (N,) which.
    height_m
        Of the cameras above the ground.
    """

    center: Floats
    rotation: Floats
    point: Floats
    sightings: TiedRays
    wrong: Bools
    height_m: float
    swell_m: float = 0.0

    def ground_m(self, place: Floats) -> Floats:
        """(...) height of the ground at places (..., 2 or 3): waves towards the east."""
        return swell(place, self.swell_m)


SWELL_M = 25.0
"""From wave to wave."""


def swell(place: Floats, height_m: float) -> Floats:
    """(...) height of waves towards the east at places (..., 2 or 3)."""
    return np.asarray(height_m * np.sin(2 * np.pi * place[..., 0] / SWELL_M))


@dataclass(frozen=True)
class Conditions:
    """How a flight is flown and seen."""

    plan: str = "grid"  # orbit | strip | grid
    photos: int = 12
    tilt_deg: float = 0.0
    height_m: float = 30.0
    houses: bool = False
    noise_px: float = 0.15
    wrong: float = 0.005
    readout_s: float = 0.0
    density: float = 300.0  # points in a square of the height
    rough_m: float = 0.05
    swell_m: float = 0.0
    seed: int = 0


def looking(heading: Floats, tilt: Floats) -> Floats:
    """(F, 3, 3) world from camera: image up towards the heading, tilted up from straight down."""
    north = np.stack([np.sin(heading), np.cos(heading), 0 * heading], axis=1)
    right = np.stack([np.cos(heading), -np.sin(heading), 0 * heading], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    forward = np.sin(tilt)[:, None] * north - np.cos(tilt)[:, None] * up
    return np.stack([right, np.cross(forward, right), forward], axis=2)


def planned(c: Conditions, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Centres (F, 3), rotations (F, 3, 3) and velocities (F, 3) of a flight."""
    n, h, tilt = c.photos, c.height_m, np.radians(c.tilt_deg)
    step = 0.3 * h
    if c.plan == "orbit":
        angle = np.arange(n) * 2 * np.pi / max(n, 12) + rng.uniform(0, 2 * np.pi)
        radius = h * np.tan(max(tilt, 0.3))
        place = radius * np.stack([np.sin(angle), np.cos(angle)], axis=1)
        heading = angle + np.pi
        along = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    else:
        lines = 1 if c.plan == "strip" else max(2, round(np.sqrt(n / 2)))
        each = int(np.ceil(n / lines))
        k = np.arange(n)
        row, column = k // each, k % each
        back = row % 2 == 1
        column = np.where(back, each - 1 - column, column)
        place = np.stack([row * 0.4 * h, column * step], axis=1).astype(float)
        heading = np.where(back & (c.tilt_deg == 0), np.pi, 0.0)
        along = np.stack([0 * k, np.where(back, -1.0, 1.0)], axis=1)
    place = place - place.mean(axis=0) + rng.normal(0, 0.03 * h, place.shape) * (c.plan != "strip")
    up = h + rng.normal(0, 0.02 * h, n)
    center = np.column_stack([place, up])
    rotation = looking(heading + rng.normal(0, 0.05, n), tilt + rng.normal(0, 0.03, n))
    rotation = rotation @ exp_so3(rng.normal(0, 0.03, (n, 3)))
    velocity = np.column_stack([along * rng.uniform(3, 8), np.zeros(n)])
    return center, rotation, velocity


def tied_flight(c: Conditions) -> TiedFlight:
    """A flight as the conditions say."""
    rng = np.random.default_rng(c.seed)
    center, rotation, velocity = planned(c, rng)
    reach = np.abs(center[:, :2]).max(axis=0) + c.height_m * (0.9 + np.tan(np.radians(c.tilt_deg)))
    count = int(c.density * 4.0 * np.prod(reach) / c.height_m**2)
    level = rng.uniform(-1, 1, (count, 2)) * reach
    point = np.column_stack([level, rng.normal(0, c.rough_m, count) + swell(level, c.swell_m)])
    if c.houses:
        corner = rng.uniform(-1, 1, (12, 2)) * reach
        inside = np.abs(point[:, None, :2] - corner).max(axis=2) < 5.0
        tall = rng.uniform(3.0, 0.25 * c.height_m, 12)
        point[:, 2] += np.max(inside * tall, axis=1)
    spin = rng.normal(0, np.radians(4.0), (len(center), 3))
    pixel, sees = _seen(center, rotation, point)
    shift = velocity * c.readout_s
    if c.readout_s:
        for _ in range(3):
            late = pixel[..., 1] / (2 * HALF_PX[1])
            moved = center[:, None] + late[..., None] * shift[:, None]
            turned = rotation[:, None] @ exp_so3(late[..., None] * spin[:, None] * c.readout_s)
            d = np.einsum("ftj,ftji->fti", point[None] - moved, turned)
            pixel = FOCAL_PX * d[..., :2] / np.maximum(d[..., 2:], 1e-6)
    sees &= _recognised(center, point, sees, rng)
    frame, which = np.nonzero(sees)
    places = pixel[frame, which] + rng.normal(0, c.noise_px, (len(frame), 2))
    wrong = rng.random(len(frame)) < c.wrong
    places[wrong] = rng.uniform(-HALF_PX, HALF_PX, (wrong.sum(), 2))
    often = np.bincount(which, minlength=count)[which] >= 2
    frame, which, places, wrong = frame[often], which[often], places[often], wrong[often]
    used, at = np.unique(which, return_inverse=True)
    ray = np.column_stack([places / FOCAL_PX, np.ones(len(places))])
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    sightings = TiedRays(
        frame=frame,
        point=at,
        ray=ray,
        sigma_rad=np.full(len(ray), c.noise_px / FOCAL_PX),
        frames=len(center),
        points=len(used),
    )
    return TiedFlight(center, rotation, point[used], sightings, wrong, c.height_m, c.swell_m)


def _seen(center: Floats, rotation: Floats, point: Floats) -> tuple[Floats, Bools]:
    d = np.einsum("ftj,fji->fti", point[None] - center[:, None], rotation)
    pixel = FOCAL_PX * d[..., :2] / np.maximum(d[..., 2:], 1e-6)
    return pixel, (d[..., 2] > 0) & (np.abs(pixel) < HALF_PX - 20).all(axis=2)


def _recognised(center: Floats, point: Floats, sees: Bools, rng: np.random.Generator) -> Bools:
    """(F, T) texture is found again near the direction from which it was first looked at."""
    to = center[:, None] - point[None]
    to /= np.linalg.norm(to, axis=2)[..., None]
    chosen = np.argmax(rng.random(sees.shape) * sees, axis=0)
    base = to[chosen, np.arange(len(point))]
    angle = np.degrees(np.arccos(np.clip(np.einsum("fti,ti->ft", to, base), -1, 1)))
    return np.asarray(rng.random(angle.shape) < 0.8 * np.exp(-((angle / 25.0) ** 2)))


TWENTY = tuple(
    Conditions(plan=plan, photos=photos, tilt_deg=tilt, houses=houses, seed=seed)
    for seed, (plan, photos, tilt, houses) in enumerate(
        [
            ("strip", 8, 0, False),
            ("strip", 15, 0, True),
            ("strip", 10, 30, False),
            ("strip", 20, 40, True),
            ("grid", 8, 0, False),
            ("grid", 12, 0, True),
            ("grid", 20, 0, False),
            ("grid", 40, 0, True),
            ("grid", 40, 0, False),
            ("grid", 12, 20, False),
            ("grid", 20, 30, True),
            ("grid", 30, 45, False),
            ("grid", 40, 45, True),
            ("orbit", 8, 45, False),
            ("orbit", 12, 45, True),
            ("orbit", 16, 35, False),
            ("orbit", 24, 50, False),
            ("orbit", 36, 40, True),
            ("orbit", 40, 45, False),
            ("orbit", 10, 25, False),
        ]
    )
)
"""Twenty flights, looking down and aside, nearly flat and with houses."""


def errors_of(flight: TiedFlight, found: TiedPoses) -> tuple[float, float]:
    """Largest turn [deg] and shift (as a share of the height) of poses after the best similarity.

    The rotation is that of the attitudes: positions on a line leave one open.
    """
    placed = found.placed
    here, there = found.center[placed], flight.center[placed]
    product = np.einsum("fij,fkj->ik", flight.rotation[placed], found.rotation[placed])
    left, _, right = np.linalg.svd(product)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    source, target = (here - here.mean(axis=0)) @ turn.T, there - there.mean(axis=0)
    scale = np.sum(source * target) / np.sum(source**2)
    off = np.linalg.norm(scale * source - target, axis=1).max() / flight.height_m
    rest = turn @ found.rotation[placed] - flight.rotation[placed]
    angle = 2.0 * np.arcsin(np.minimum(np.linalg.norm(rest, axis=(1, 2)) / np.sqrt(8.0), 1.0))
    return float(np.degrees(angle.max())), float(off)
