"""Surveys with known truth, as users have them, each made hostile in stated ways.

`make_survey` draws one, `hostile_project.write_project` writes the folder that `uavgram run` takes;
the studies are `tests/benchmarks/study_reality.py` and `tests/benchmarks/study_heights.py`. Nothing
of the program's own mathematics takes part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import combinations
from typing import NamedTuple

import numpy as np
from hostile_conditions import Condition
from hostile_log import START_UTC_S, record
from hostile_things import draw_geometry, draw_things
from hostile_ties import Found, draw_ties, match_picks
from hostile_world import (
    ORDINARY,
    SHARP,
    StatedCamera,
    TrueFlight,
    TrueGround,
    draw_flight,
    draw_ground,
    draw_lenses,
    photograph,
)
from scipy.spatial import ConvexHull

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import SimulatedLog

LEAST_APART_M = 2.5
PICK_SIGMA_PX = 0.8
LENGTHS, LENGTH_SIGMA_M = 6, 0.01
DISTANCES, NEAREST_M = 15, 4.0
CLOCK_SIGMA_S = 0.3
ROUGHNESS_M, IDENTIFICATION_M = 0.02, 0.01
MARGIN_PX = 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class HostileSurvey:
    """What the user has, and the true values of what is measured.

    Attributes
    ----------
    camera
        As calibrated.
    photo
        (f,) names; the time of the camera's clock stands in them.
    pick_photo, pick_label, pick_px
        (p,), (p,), (p, 2).
    line, line_length_m, level
        (l, 2) indices of labels; (l,) as read; whether the tape was held level.
    measure
        Name -> kind and indices of labels.
    truth
        Name -> true value [m, m2, degrees].
    log
        None: there is no log.
    world_m, height_m, off_ground
        (k, 3) true points; (k,) true heights over the ground straight below; (k,) which are known
        to lie off it.
    center_m
        (f, 3) where the photos were taken.
    ties, matches
        What the program finds by itself, if anything.
    """

    camera: StatedCamera
    photo: tuple[str, ...]
    pick_photo: Ints
    pick_label: Ints
    pick_px: Floats
    line: Ints
    line_length_m: Floats
    level: bool
    measure: Mapping[str, tuple[str, tuple[int, ...]]]
    truth: Mapping[str, float]
    log: SimulatedLog | None
    world_m: Floats
    height_m: Floats
    off_ground: Bools
    center_m: Floats
    ties: Found | None
    matches: Found | None


def make_survey(condition: Condition, seed: int) -> HostileSurvey:
    """The survey of a seed under a condition; the same seed gives nearly the same clean survey."""
    rngs = (np.random.default_rng([seed, part]) for part in range(7))
    ground_rng, flight_rng, pick_rng, line_rng, log_rng, scale_rng, thing_rng = rngs
    condition = draw_geometry(condition, thing_rng)
    ground = draw_ground(condition, ground_rng)
    flight = draw_flight(condition, ground.middle, flight_rng)
    drawn = scale_rng.standard_normal(4)
    readout_s = condition.readout_s + 0.03 * drawn[0] * condition.draws_readout
    scale = condition.tape_scale + 0.001 * drawn[1] * condition.draws_scale
    things_m, off = draw_things(condition, ground, thing_rng)
    world_m = np.concatenate([_labels(condition, ground, ground_rng), things_m])
    off = np.concatenate([np.zeros(condition.labels, dtype=np.bool_), off])
    raised = np.zeros(len(world_m))
    for one, above_m in condition.raised:
        raised[one] = above_m
    world_m[:, 2] += raised
    camera = SHARP if condition.sharp else ORDINARY
    scene = Scene(condition, camera, ground, flight, world_m)
    beside = np.random.default_rng([seed, 8]).standard_normal((len(world_m), 2))
    beside *= IDENTIFICATION_M * condition.draws_identification
    shown = scene._replace(world_m=_moved(ground, world_m, beside))
    (frame, label, pixel), lens = _picks(shown, readout_s, pick_rng)
    if condition.single:
        kept = frame == int(abs(drawn[2]) * 1000) % len(flight.exposure_s)
        frame, label, pixel = frame[kept], label[kept], pixel[kept]
    line = _pairs(condition, world_m, np.unique(label[~off[label]]), line_rng)[:LENGTHS]
    kept = pick_rng.random(len(label)) < condition.picked_share
    kept |= np.isin(label, line)  # who tapes a length picks its ends wherever he sees them
    frame, label, pixel = frame[kept], label[kept], pixel[kept]
    found_rng = np.random.default_rng([seed, 7])
    ties, matches = None, None
    if condition.ties:
        ties = draw_ties(scene, lens, readout_s, found_rng)
    if condition.matched:
        own = frame, label, pixel
        (frame, label, pixel), matches = match_picks(shown, lens, readout_s, own, found_rng)
    measure = _wanted(
        scene,
        _placeable(label if matches is None else np.concatenate([label, matches.point]), off),
        off,
        line,
        line_rng,
    )
    read_m = _read_lengths(condition, world_m[line], scale, line_rng)
    clock_s = CLOCK_SIGMA_S * drawn[3] + condition.lag_s
    since = flight.exposure_s - flight.exposure_s.mean()
    stated_s = flight.exposure_s + clock_s + 1e-6 * condition.drift_ppm * since
    used = np.unique(frame)
    if ties is not None or matches is not None:
        used = np.arange(len(flight.exposure_s))
    return HostileSurvey(
        camera=camera,
        photo=tuple(_photo_name(stated_s[k]) for k in used),
        pick_photo=np.searchsorted(used, frame),
        pick_label=label,
        pick_px=pixel,
        line=line,
        line_length_m=read_m,
        level=condition.horizontal_tape,
        measure=measure,
        truth={name: _value(kind, world_m[list(at)]) for name, (kind, at) in measure.items()},
        log=record(condition, flight, log_rng) if condition.has_log else None,
        world_m=world_m,
        height_m=np.where(off, world_m[:, 2] - ground.up(world_m[:, :2]), raised),
        off_ground=off,
        center_m=flight.camera(flight.exposure_s)[0][used],
        ties=ties,
        matches=matches,
    )


def _photo_name(since_start_s: float) -> str:
    moment = datetime.fromtimestamp(START_UTC_S + since_start_s, UTC)
    return f"{moment:%Y%m%d_%H%M%S_%f}"


def _labels(condition: Condition, ground: TrueGround, rng: np.random.Generator) -> Floats:
    """(k, 3) points of the ground that lie apart from each other."""
    place = np.empty((0, 2))
    radius_m = condition.radius_m
    while len(place) < condition.labels:
        new = ground.middle + rng.uniform(-radius_m, radius_m, 2)
        inside = np.linalg.norm(new - ground.middle) < radius_m
        if inside and (np.linalg.norm(place - new, axis=1) > LEAST_APART_M).all():
            place = np.vstack([place, new])
    own_m = condition.relief_m * (not condition.relief_length_m)
    own = (own_m or ROUGHNESS_M * condition.draws_relief) * rng.standard_normal(len(place))
    return np.column_stack([place, ground.up(place) + own])


def _moved(ground: TrueGround, world_m: Floats, by_m: Floats) -> Floats:
    """(n, 3) places that lie (n, 2) east and north of others, as high over the ground."""
    place = world_m[:, :2] + by_m
    rise = ground.up(place) - ground.up(world_m[:, :2])
    return np.column_stack([place, world_m[:, 2] + rise])


class Scene(NamedTuple):
    condition: Condition
    camera: StatedCamera
    ground: TrueGround
    flight: TrueFlight
    world_m: Floats


def _picks(
    scene: Scene, readout_s: float, rng: np.random.Generator
) -> tuple[tuple[Ints, Ints, Floats], Floats]:
    """Frames, labels and pixels (p, 2) of all that lies inside the photos, as someone picks it.

    And the lenses (f, 9) of the photos.
    """
    condition, camera, ground, flight, world_m = scene
    count = len(flight.exposure_s)
    frame, label = (part.ravel() for part in np.mgrid[:count, : len(world_m)])
    moved = condition.identification_m * rng.standard_normal((len(frame), 2))
    identified = _moved(ground, world_m[label], moved)
    lens = draw_lenses(condition, camera, count, rng)
    pixel, depth = photograph(flight, lens[frame], frame, identified, (camera.height_px, readout_s))
    tail = np.where(rng.random((len(frame), 1)) < condition.heavy_tails, 5.0, 1.0)
    pixel += PICK_SIGMA_PX * condition.pick_factor * tail * rng.standard_normal(pixel.shape)
    inside = (depth > 0) & (pixel > MARGIN_PX).all(axis=1)
    inside &= (pixel < np.array([camera.width_px, camera.height_px]) - MARGIN_PX).all(axis=1)
    return (frame[inside], label[inside], pixel[inside]), lens


def _pairs(condition: Condition, world_m: Floats, seen: Ints, rng: np.random.Generator) -> Ints:
    """(n, 2) labels of a distance that someone tapes or wants to know, in any order."""
    pairs = np.array(list(combinations(seen.tolist(), 2)))
    apart = np.linalg.norm(np.diff(world_m[pairs], axis=1)[:, 0], axis=1)
    return rng.permutation(pairs[(apart > NEAREST_M) & (apart < condition.farthest_m)])


def _placeable(label: Ints, off: Bools) -> Ints:
    """Labels picked once at least, and twice where off the ground."""
    picks = np.bincount(label, minlength=len(off))
    return np.flatnonzero(picks > off)


def _wanted(
    scene: Scene, seen: Ints, off: Bools, taped: Ints, rng: np.random.Generator
) -> dict[str, tuple[str, tuple[int, ...]]]:
    """What to measure: distances that were not taped, an area and an angle on the ground.

    Where there are points off the ground, every distance is of one of them from one of the ground.
    """
    condition, *_, world_m = scene
    pairs = _pairs(condition, world_m, seen, rng)
    if off.any():
        pairs = pairs[off[pairs].sum(axis=1) == 1]
    free = pairs[~(pairs[:, None] == taped).all(axis=-1).any(axis=1)][:DISTANCES]
    measure: dict[str, tuple[str, tuple[int, ...]]] = {
        f"distance {k}": ("distance", (int(a), int(b))) for k, (a, b) in enumerate(free)
    }
    seen = seen[~off[seen]]
    hull = seen[ConvexHull(world_m[seen, :2]).vertices]
    corners = hull[np.linspace(0, len(hull), 4, endpoint=False).astype(int)]
    measure["area"] = ("area", tuple(corners.tolist()))
    measure["angle"] = ("angle", tuple(corners[:3].tolist()))
    return measure


def _read_lengths(
    condition: Condition, ends_m: Floats, scale: float, rng: np.random.Generator
) -> Floats:
    """(l,) lengths as read, of (l, 2, 3) ends."""
    leg = np.diff(ends_m, axis=1)[:, 0]
    noise = LENGTH_SIGMA_M * condition.length_factor * rng.standard_normal(len(leg))
    wrong = condition.wrong_length_m * (np.arange(len(leg)) == rng.integers(len(leg)))
    if condition.horizontal_tape:
        leg = leg[:, :2]
    return np.asarray(np.linalg.norm(leg, axis=1) * (1 + scale) + noise + wrong)


def _value(kind: str, points: Floats) -> float:
    """True distance, area (of the outline as seen along its own normal), angle in degrees."""
    if kind == "distance":
        return float(np.linalg.norm(points[1] - points[0]))
    if kind == "area":
        twice = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0])
        return float(np.linalg.norm(twice.sum(axis=0)) / 2)
    one, other = points[0] - points[1], points[2] - points[1]
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.rad2deg(np.arccos(cosine)))
