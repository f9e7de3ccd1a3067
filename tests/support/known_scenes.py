"""Surveys in which one thing is known, as true as its sigma says; its points stand by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scenes import PIXEL_SIGMA, Scene, cv_pixels, make_scene
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.known_kinds import KNOWN_KINDS
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing, LinePosition

SIGMA_M, SIGMA_DEG = 0.003, 0.03
"""Far below what the picks of a scene tell: then the known thing decides, and its sigma shows."""


@dataclass(frozen=True)
class Placed:
    """Points of a known thing.

    Attributes
    ----------
    world
        (k, 3) true places [m]; those that are not at z = 0 have free heights.
    value
        What is known; NaN for a condition.
    truth
        (r,) true values of its rows: departures from what is known.
    position
        Of points on a line of known position: where that is said to be.
    """

    world: Floats
    value: float
    truth: Floats
    position: LinePosition | None = None


Place = Callable[[np.random.Generator, float], Placed]


def ground(*points: tuple[float, float]) -> Floats:
    """(k, 3) places at z = 0."""
    return np.column_stack([np.array(points), np.zeros(len(points))])


def stated(world: Floats, truth: float, rng: np.random.Generator, sigma: float) -> Placed:
    """A value that was measured with an error."""
    value = truth + sigma * rng.normal()
    return Placed(world, value, np.array([truth - value]))


def distance(rng: np.random.Generator, sigma: float) -> Placed:
    world = ground((-3, 1), (4, 2))
    return stated(world, float(np.hypot(7, 1)), rng, sigma)


def polyline(rng: np.random.Generator, sigma: float) -> Placed:
    return stated(ground((-3, 1), (1, 4), (5, 1)), 10.0, rng, sigma)


def area(rng: np.random.Generator, sigma: float) -> Placed:
    return stated(ground((-3, 0), (3, 0), (3, 4), (-3, 4)), 24.0, rng, sigma)


def angle(rng: np.random.Generator, sigma: float) -> Placed:
    return stated(ground((4, 0), (0, 0), (3, 3)), 45.0, rng, sigma)


def line_distance(rng: np.random.Generator, sigma: float) -> Placed:
    return stated(ground((1, 2.5), (-4, 1), (5, 1)), 1.5, rng, sigma)


def on_a_line(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal()
    return Placed(ground((1, 1 + off), (-4, 1), (5, 1)), 0.0, np.array([off]))


def height(rng: np.random.Generator, sigma: float) -> Placed:
    return stated(np.array([[1.0, 2.0, 1.4]]), 1.4, rng, sigma)


def slope(rng: np.random.Generator, sigma: float) -> Placed:
    rise = float(np.rad2deg(np.arctan2(1.0, 5.0)))
    return stated(np.array([[-1, 0, 0.5], [3, 3, 1.5]]), rise, rng, sigma)


def azimuth(rng: np.random.Generator, sigma: float) -> Placed:
    bearing = float(np.rad2deg(np.arctan2(5.0, -3.0)))
    return stated(ground((-2, 3), (3, 0)), bearing, rng, sigma)


def plane_distance(rng: np.random.Generator, sigma: float) -> Placed:
    world = np.array([[1, 1, 2.1], [-3, -2, 1.8], [3, -2, 1.8], [0, 4, 1.8]])
    return stated(world, 0.3, rng, sigma)


def right_angle(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal()
    turn = np.deg2rad(90.0 - off)
    world = ground((4, 0), (0, 0), (3 * np.cos(turn), 3 * np.sin(turn)))
    return Placed(world, np.nan, np.array([off]))


def collinear(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal(size=2)
    world = ground((-5, 0), (-1, off[0]), (2, off[1]), (5, 0))
    return Placed(world, np.nan, off)


def collinear_in_the_air(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal(size=2)
    world = np.array([[-5, 0, 1], [1, off[0], 1 + off[1]], [5, 0, 1.0]])
    return Placed(world, np.nan, off)


def parallel(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal()
    along = 6 * np.array([np.cos(np.deg2rad(off)), np.sin(np.deg2rad(off))])
    world = ground((-4, -1), (4, -1), (-3, 3), (-3 + along[0], 3 + along[1]))
    return Placed(world, np.nan, np.array([off]))


def coplanar(rng: np.random.Generator, sigma: float) -> Placed:
    """Of a level plane turned by hand; the normal is the turned vertical."""
    off = sigma * rng.normal(size=2)
    flat = np.array([[-3, -2, 0], [3, -2, 0], [0, 4, 0], [1, 1, off[0]], [-3, 3, off[1]]])
    turn = Rotation.from_euler("xy", [0.1, -0.2]).as_matrix()
    return Placed(flat @ turn.T + [0, 0, 1.5], np.nan, off)


def level(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal(size=2)
    world = np.array([[-3, 0, 1.2], [2, 1, 1.2 + off[0]], [0, 4, 1.2 + off[1]]])
    return Placed(world, np.nan, off)


def vertical(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal(size=2)
    return Placed(np.array([[1, 2, 0], [1 + off[0], 2 + off[1], 1.8]]), np.nan, off)


def equal_lengths(rng: np.random.Generator, sigma: float) -> Placed:
    off = sigma * rng.normal()
    return Placed(ground((-4, 0), (-4, 5), (2, 0), (2, 5 + off)), np.nan, np.array([off]))


def on_a_line_of_position(rng: np.random.Generator, sigma: float) -> Placed:
    """Four points on a kerb whose stated ends err, each a little beside it."""
    stated_ends = ground((-7, -1), (6, -1)) + sigma * rng.normal(size=(2, 3)) * [1, 1, 0]
    east, own = np.array([-5.0, -4.5, -4.0, -3.5]), sigma / 3
    world = ground(*((e, -1.0 + own * rng.normal()) for e in east))
    ahead = stated_ends[1] - stated_ends[0]
    left = np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead[:2])
    position = LinePosition(
        ends_m=stated_ends, sigma_m=np.full((2, 3), sigma), straightness_m=own, has_height=False
    )
    return Placed(world, np.nan, (world - stated_ends[0])[:, :2] @ left, position)


PLACES: dict[str, tuple[str, Place]] = {
    "distance": ("distance", distance),
    "polyline": ("polyline", polyline),
    "area": ("area", area),
    "angle": ("angle", angle),
    "line_distance": ("line_distance", line_distance),
    "on a line": ("line_distance", on_a_line),
    "height": ("height", height),
    "slope": ("slope", slope),
    "plane_distance": ("plane_distance", plane_distance),
    "azimuth": ("azimuth", azimuth),
    "right_angle": ("right_angle", right_angle),
    "collinear": ("collinear", collinear),
    "collinear in the air": ("collinear", collinear_in_the_air),
    "parallel": ("parallel", parallel),
    "coplanar": ("coplanar", coplanar),
    "level": ("level", level),
    "vertical": ("vertical", vertical),
    "equal_lengths": ("equal_lengths", equal_lengths),
}


def known_scene(seed: int, name: str, blunder: float = 0.0) -> tuple[Scene, Floats]:
    """A scene with one known thing, and the true departures (r,) of its rows.

    Parameters
    ----------
    seed
        Of its errors.
    name
        One of `PLACES`.
    blunder
        By which its value is wrong.
    """
    kind, place = PLACES[name]
    rng = np.random.default_rng([seed, 7])
    sigma = SIGMA_DEG if KNOWN_KINDS[kind].unit == "deg" else SIGMA_M
    placed = place(rng, sigma)
    count = len(placed.world)
    scene = make_scene(seed, frames=3, labels=count + 6, lines=4, sources=("pixels",))
    return with_known(scene, kind, placed, sigma, rng, blunder), placed.truth - blunder


def with_known(
    scene: Scene,
    kind: str,
    placed: Placed,
    sigma: float,
    rng: np.random.Generator,
    blunder: float,
) -> Scene:
    """The scene with its first points where they are known to be, and picked there."""
    count, survey = len(placed.world), scene.survey
    thing = KnownThing(
        index=0,
        name="K",
        kind=kind,
        label=tuple(range(count)),
        value=placed.value + blunder,
        sigma=sigma if placed.position is None else placed.position.across_m,
        position=placed.position,
    )
    free = np.zeros(len(survey.label), dtype=bool)
    free[:count] = placed.world[:, 2] != 0
    planar = scene.truth.point[:, :2].copy()
    planar[:count] = placed.world[:, :2]
    world = np.column_stack([planar, scene.world[:, 2]])
    plane, pivot = scene.truth.plane, scene.pivot
    surface = plane[0] + (planar - pivot) @ plane[1:]
    world[:, 2] = np.where(free, 0.0, surface)
    world[:count, 2] += placed.world[:, 2]
    point = np.column_stack([planar, world[:, 2] - surface]) if free.any() else planar
    problem = SurveyProblem(survey, pivot, np.ones(len(survey.line_start), dtype=bool))
    intrinsics = problem.intrinsics(scene.truth)
    pixels = np.stack(
        [
            cv_pixels(intrinsics, center, rotation, world)[0]
            for center, rotation in zip(scene.truth.center, scene.truth.rotation, strict=True)
        ]
    )
    frame, label = np.divmod(np.arange(pixels.shape[0] * pixels.shape[1]), pixels.shape[1])
    pixel = pixels.reshape(-1, 2)
    start, end = survey.line_start, survey.line_end
    length = np.linalg.norm(world[start] - world[end], axis=1)
    survey = replace(
        survey,
        known=(thing,),
        is_free=free,
        pick_frame=frame,
        pick_label=label,
        pixel_px=pixel + PIXEL_SIGMA * rng.normal(size=pixel.shape),
        pick_sigma_px=np.full(len(pixel), PIXEL_SIGMA),
        length_m=length + survey.length_sigma_m * rng.normal(size=len(length)),
    )
    return replace(scene, survey=survey, truth=replace(scene.truth, point=point), world=world)
