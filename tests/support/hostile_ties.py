"""What the program finds in the photos of a made-up survey: tie points, and matches of picks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from hostile_world import photograph

from uavgram.model.arrays import Floats, Ints

if TYPE_CHECKING:
    from hostile_surveys import Scene

TIE_SIGMA_PX, MATCH_SIGMA_PX = 0.15, 0.06
HOUSES_M, SHARE_OF_HOUSES = 4.0, 0.2
OFF_PX = 15.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """(n,) photos, (n,) points or labels, (n, 2) pixels; of matches (n,) the photo of the pick."""

    photo: Ints
    point: Ints
    pixel_px: Floats
    from_photo: Ints


def draw_ties(scene: Scene, lens: Floats, readout_s: float, rng: np.random.Generator) -> Found:
    """Sightings of points on the ground, and up to four metres above it, a few of them wrong."""
    condition, camera, ground, flight, _ = scene
    count = len(flight.exposure_s)
    reach = condition.radius_m + 0.5 * condition.stride_m * count
    place = ground.middle + rng.uniform(-reach, reach, (condition.ties, 2))
    height = HOUSES_M * rng.random(condition.ties) * (rng.random(condition.ties) < SHARE_OF_HOUSES)
    height += (
        condition.relief_m * rng.standard_normal(condition.ties) * (not condition.relief_length_m)
    )  # as labels have it
    world = np.column_stack([place, ground.up(place) + height])
    frame, point = (part.ravel() for part in np.mgrid[:count, : condition.ties])
    seen = rng.random(len(frame)) < 0.6
    frame, point = frame[seen], point[seen]
    rows = (camera.height_px, readout_s)
    pixel, depth = photograph(flight, lens[frame], frame, world[point], rows)
    pixel += TIE_SIGMA_PX * rng.standard_normal(pixel.shape)
    wrong = rng.random(len(pixel)) < condition.wrong_found
    pixel[wrong] += OFF_PX * rng.standard_normal((int(wrong.sum()), 2))
    size = np.array([camera.width_px, camera.height_px])
    inside = (depth > 0) & (pixel > 15).all(axis=1) & (pixel < size - 15).all(axis=1)
    frame, point, pixel = frame[inside], point[inside], pixel[inside]
    return Found(photo=frame, point=point, pixel_px=pixel, from_photo=np.full(len(frame), -1))


def match_picks(
    scene: Scene,
    lens: Floats,
    readout_s: float,
    picks: tuple[Ints, Ints, Floats],
    rng: np.random.Generator,
) -> tuple[tuple[Ints, Ints, Floats], Found]:
    """One pick of each label, and where the program finds in other photos what lies under it.

    Parameters
    ----------
    scene, lens, readout_s
        The truth.
    picks
        (p,), (p,), (p, 2) frames, labels and pixels, as a person picks them.
    rng
        Draws which pick stays, and the errors of the matches.
    """
    condition, camera, ground, flight, world = scene
    frame, label, pixel = picks
    order = rng.permutation(len(frame))
    first = order[np.unique(label[order], return_index=True)[1]]
    rows = (camera.height_px, readout_s)

    def seen(place: Floats, k: Ints, frames: Ints) -> Floats:
        off = world[k, 2] - ground.up(world[k, :2])
        at = np.column_stack([place, ground.up(place) + off])
        return photograph(flight, lens[frames], frames, at, rows)[0]

    own, source = label[first], frame[first]
    place = world[own, :2].copy()
    for _ in range(6):  # what lies under the picked pixel
        now = seen(place, own, source)
        steps = [(seen(place + h, own, source) - now) / 0.01 for h in 0.01 * np.eye(2)]
        place += np.linalg.solve(np.stack(steps, axis=2), (pixel[first] - now)[..., None])[..., 0]
    under = np.full((len(world), 2), np.nan)
    under[own] = place
    from_photo = np.full(len(world), -1)
    from_photo[own] = source
    others = np.setdiff1d(np.arange(len(frame)), first)
    found = seen(under[label[others]], label[others], frame[others])
    found += MATCH_SIGMA_PX * rng.standard_normal(found.shape)
    wrong = rng.random(len(found)) < condition.wrong_found
    found[wrong] += OFF_PX * rng.standard_normal((int(wrong.sum()), 2))
    matches = Found(
        photo=frame[others],
        point=label[others],
        pixel_px=found,
        from_photo=from_photo[label[others]],
    )
    return (frame[first], label[first], pixel[first]), matches
