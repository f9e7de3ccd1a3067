"""What stands on the ground of a made-up survey: cars, walls, kerbs, with ground points beside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hostile_conditions import Condition
from hostile_world import TrueGround

from uavgram.model.arrays import Bools, Floats

LENGTH_M, WIDTH_M = 4.3, 1.8
ROOF = np.array([[-1.1, -0.55], [0.6, -0.55], [0.6, 0.55], [-1.1, 0.55]])
BONNET = np.array([[2.0, -0.7], [2.0, 0.7]])
WHEELS = np.array([[-1.35, -0.9], [1.35, -0.9], [1.35, 0.9], [-1.35, 0.9]])
WALL_M, THICK_M = 5.0, 0.3
KERB_M = 8.0


def draw_geometry(condition: Condition, rng: np.random.Generator) -> Condition:
    """A condition of any geometry becomes one of a geometry of its own.

    2 to 12 photos: a line of nadir ones, an arc of oblique ones, or from the one to the other.
    """
    if not condition.any_geometry:
        return condition
    tilt = rng.uniform(25, 50)
    kinds = {"nadir": (0.0, 0.0), "oblique": (tilt, tilt), "both": (0.0, tilt)}
    return replace(
        condition,
        photos=int(rng.integers(2, 13)),
        tilts_deg=kinds[str(rng.choice(list(kinds)))],
        stride_m=float(rng.uniform(3, 9)),
    )


def draw_things(
    condition: Condition, ground: TrueGround, rng: np.random.Generator
) -> tuple[Floats, Bools]:
    """Points (k, 3) of all things and of the ground at their feet, and which are off the ground.

    A car and a wall stand level on the ground at their middle; a kerb follows the ground.
    """
    points, off = [np.empty((0, 3))], [np.zeros(0, dtype=np.bool_)]
    things = [_car] * condition.cars + [_wall] * condition.walls + [_kerb] * condition.kerbs
    for thing in things:
        shape, above, follows = thing(rng)
        far, heading, turn = rng.uniform([0, 0, 0], [condition.radius_m, 2 * np.pi, 2 * np.pi])
        middle = ground.middle + far * np.array([np.sin(heading), np.cos(heading)])
        along = np.array([np.sin(turn), np.cos(turn)])
        place = middle + shape @ np.stack([along, along[::-1] * [1, -1]])
        foot = ground.up(place)
        base = foot if follows else np.where(above > 0, ground.up(middle[None]), foot)
        points.append(np.column_stack([place, base + above]))
        off.append(above > 0)
    return np.concatenate(points), np.concatenate(off)


def _car(rng: np.random.Generator) -> tuple[Floats, Floats, bool]:
    """Corners of roof and bonnet, and where the wheels touch the ground: (k, 2), heights (k,)."""
    roof, bonnet = rng.uniform(1.3, 1.6), rng.uniform(0.75, 1.0)
    shape = np.concatenate([ROOF, BONNET, WHEELS])
    above = np.repeat([roof, bonnet, 0.0], [len(ROOF), len(BONNET), len(WHEELS)])
    return shape, above, False


def _wall(rng: np.random.Generator) -> tuple[Floats, Floats, bool]:
    """Corners of a wall's top, and two places at its foot."""
    side = THICK_M / 2
    ends = np.array([[0.0, 1], [0, -1], [WALL_M, -1], [WALL_M, 1]]) * [1, side]
    feet = np.array([[0.0, side], [WALL_M, side]])
    above = np.repeat([rng.uniform(0.5, 2.5), 0.0], [len(ends), len(feet)])
    return np.concatenate([ends, feet]), above, False


def _kerb(rng: np.random.Generator) -> tuple[Floats, Floats, bool]:
    """The upper edge of a kerb, and the road right below it."""
    stations = np.linspace(0, KERB_M, 4)
    edge, road = (np.column_stack([stations, np.full(4, across)]) for across in (0.0, 0.02))
    above = np.repeat([rng.uniform(0.08, 0.16), 0.0], [len(edge), len(road)])
    return np.concatenate([edge, road]), above, True
