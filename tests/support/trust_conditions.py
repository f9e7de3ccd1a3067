"""Ordinary surveys for the study of trust: what differs between them is in `CONDITIONS`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from trust_world import (
    Floats,
    Line,
    Log,
    Pose,
    Survey,
    Wander,
    body_turn,
    draw_ground,
    draw_lens,
    mount_turn,
    photograph,
    turn_of,
)

EVERY_S = 4.0
"""Between photos."""
LINE_SIGMA_M = 0.01
CLOCK_SIGMA_S = 0.05


@dataclass(frozen=True, kw_only=True)
class World:
    """One kind of survey.

    Attributes
    ----------
    photos, path
        How many, flown as `single`, `strip` (there and back), `facing` (from both sides), `curve`.
    height_m, tilt_deg
        Above the ground; off nadir, towards the vehicle's nose. Ranges.
    log
        None, or `gps`, or `rtk`.
    size_m
        Of the scene, along the road and across it.
    taped, marks, lengths
        Labels that lengths may join, labels that are only measured, number of lengths. Ranges.
    share
        Of the photos that show a label, those in which it is picked.
    pick_px, stated_px
        Errors of picks, and what the project says of them.
    identified_m, relief_m, own_m, kerb_m
        Per axis, common to all picks of a label; of the ground, alike nearby; of each point; step.
    slope, curve
        Of the ground up the road and across it; 1 / (2 radius) of the road's vertical curve.
    rounded_m, tape_scale
        Step to which lengths are read, sigma of the tape's common error.
    several
        Two picks are 4 px off and one length 2.5 cm: moderate errors.
    camera_auto
        A drone of the shop, whose camera the project does not state.
    clicks
        How often each label is clicked in each photo.
    measured_in
        Fewest photos that show a point that is measured.
    raised
        Number of points off the ground, whose height is declared free.
    control
        Number of points with known coordinates.
    """

    photos: int = 1
    path: str = "single"
    height_m: tuple[float, float] = (26.0, 34.0)
    tilt_deg: tuple[float, float] = (0.0, 4.0)
    log: str | None = "gps"
    size_m: tuple[float, float] = (24.0, 14.0)
    taped: tuple[int, int] = (7, 9)
    marks: tuple[int, int] = (6, 9)
    lengths: tuple[int, int] = (4, 8)
    share: float = 1.0
    pick_px: float = 1.0
    stated_px: float = 1.0
    identified_m: float = 0.005
    relief_m: float = 0.01
    own_m: float = 0.005
    kerb_m: float = 0.0
    slope: tuple[float, float] | None = None
    curve: float = 0.0
    rounded_m: float = 0.0
    tape_scale: float = 0.0005
    several: bool = False
    camera_auto: bool = False
    clicks: int = 1
    measured_in: int = 1
    raised: int = 0
    control: int = 0


STRIP = World(photos=6, path="strip", tilt_deg=(10.0, 20.0), share=0.85, lengths=(5, 7))
ASPHALT = World(
    log=None,
    height_m=(10.0, 14.0),
    tilt_deg=(65.0, 65.0),
    size_m=(20.0, 12.0),
    lengths=(6, 8),
    relief_m=0.02,
)

CONDITIONS: dict[str, World] = {
    "nadir_log": World(),
    "nadir_no_log": World(log=None),
    "oblique_asphalt": ASPHALT,
    "oblique_kerb": replace(ASPHALT, kerb_m=0.12),
    "few_points": World(log=None, taped=(5, 5), marks=(2, 2), lengths=(4, 4), tilt_deg=(20, 35)),
    "picks_3px": World(log=None, pick_px=3.0, lengths=(6, 8)),
    "identification": replace(STRIP, photos=9, identified_m=0.015, relief_m=0.0, own_m=0.0),
    "mixed_errors": replace(
        STRIP, photos=9, identified_m=0.01, relief_m=0.02, pick_px=1.5, several=True
    ),
    "hillside_curve": replace(STRIP, photos=8, path="curve", slope=(0.08, -0.04), curve=6e-4),
    "camera_auto": replace(STRIP, camera_auto=True),
    "two_free_heights": World(
        photos=2, path="facing", tilt_deg=(20, 30), height_m=(20, 26), lengths=(6, 7), raised=5
    ),
    "rtk_only": replace(STRIP, photos=9, log="rtk", lengths=(0, 0)),
    "road_400m": replace(
        STRIP,
        photos=22,
        height_m=(45.0, 55.0),
        size_m=(400.0, 9.0),
        taped=(14, 14),
        marks=(26, 26),
        lengths=(9, 9),
    ),
    "lengths_decimetre": replace(STRIP, photos=9, rounded_m=0.1, lengths=(8, 9)),
    "clicked_twice": World(log=None, clicks=2, lengths=(5, 5), taped=(7, 7)),
    "clicked_twice_log": World(clicks=2, lengths=(5, 5), taped=(7, 7)),
    "two_photos_hand": replace(STRIP, photos=2, share=1.0, lengths=(6, 8), measured_in=2),
    "strip_log": STRIP,
    "strip_no_log": replace(STRIP, log=None),
    "strip_control": replace(STRIP, control=4),
    "exact": replace(STRIP, photos=9, identified_m=0.0, relief_m=0.0, own_m=0.0),
}
BASES: dict[str, World] = {
    "single": World(lengths=(6, 7)),
    "single_no_log": World(lengths=(6, 7), log=None, tilt_deg=(10, 30)),
    "strip": STRIP,
    "strip_no_log": replace(STRIP, log=None),
}
"""Where faults are planted."""


def draw(world: World, rng: np.random.Generator) -> Survey:
    """Draw a survey."""
    middle = rng.uniform(-20, 20, 2)
    azimuth = rng.uniform(0, 2 * np.pi)
    along = np.array([np.sin(azimuth), np.cos(azimuth)])
    axes = np.array([along, [along[1], -along[0]]])
    slope = None
    if world.slope is not None:
        slope = np.array(world.slope) * rng.choice([-1, 1], 2) @ axes
    ground = draw_ground(
        rng, middle, relief_m=world.relief_m, slope=slope, kerb_m=world.kerb_m, curve=world.curve
    )
    size = (5472, 3648) if world.camera_auto else (4000, 3000)
    lens = draw_lens(rng, size)
    taped, marks = (int(rng.integers(a, b + 1)) for a, b in (world.taped, world.marks))
    places = _places(world, taped + marks, rng) @ axes + middle
    labels = [f"R{k + 1}" for k in range(taped)] + [f"P{k + 1}" for k in range(marks)]
    meant: dict[str, Floats] = {}
    picked: dict[str, Floats] = {}
    raised = set(rng.choice(labels[taped:], world.raised, replace=False)) if world.raised else set()
    for label, place in zip(labels, places, strict=True):
        own = world.own_m * rng.standard_normal()
        up = rng.uniform(0.4, 1.6) if label in raised else 0.0
        beside = place + world.identified_m * rng.standard_normal(2)
        for points, at in ((meant, place), (picked, beside)):
            points[label] = np.array([*at, ground.up(at[None])[0] + own + up])
    survey = Survey(lens=lens, ground=ground, poses=[], meant=meant, picked=picked)
    if world.camera_auto:
        _consumer_camera(survey, rng)
    _fly(survey, world, azimuth, along, rng)
    photograph(survey, rng, sigma_px=world.pick_px, share=world.share, clicks=world.clicks)
    survey.options["picks_sigma_px"] = world.stated_px
    seen = {pick.label for pick in survey.picks}
    for pick in survey.picks:
        if pick.label in raised:
            pick.extra["height_m"] = "free"
    _tape(survey, world, [label for label in labels[:taped] if label in seen], rng)
    if world.several:
        _spoil_a_little(survey, rng)
    if world.control:
        chosen = rng.choice(
            [r for r in labels[:taped] if r in seen], min(world.control, taped), replace=False
        )
        for label in chosen:
            survey.control[str(label)] = survey.meant[label] + rng.normal(0, 0.02, 3)
    photos = {label: {one.photo for one in survey.picks if one.label == label} for label in seen}
    often = {label for label in seen if len(photos[label]) >= world.measured_in}
    _measure(survey, [one for one in labels if one in often], sorted(raised & often), rng)
    return survey


def _places(world: World, count: int, rng: np.random.Generator) -> Floats:
    """Draw places (n, 2) in the scene's axes, at least 1.8 m apart."""
    if world.size_m[0] > 100:
        along = np.linspace(-0.48, 0.48, count) * world.size_m[0] + rng.uniform(-4, 4, count)
        order = rng.permutation(count)
        return np.column_stack([along, rng.uniform(-0.5, 0.5, count) * world.size_m[1]])[order]
    found: list[Floats] = []
    while len(found) < count:
        place = rng.uniform(-0.5, 0.5, 2) * world.size_m
        if world.path == "curve":  # a road of 40 m radius
            turn = place[0] / 40.0
            place = np.array([(40 - place[1]) * np.sin(turn), 40 - (40 - place[1]) * np.cos(turn)])
        if all(np.linalg.norm(place - other) > 1.8 for other in found):
            found.append(place)
    return np.array(found)


def _consumer_camera(survey: Survey, rng: np.random.Generator) -> None:
    """A drone of the shop: focal length 1 % beside the one of EXIF, lens nearly straight."""
    lens = survey.lens
    focal = 8.8 / (12.83332 / 5472) * (1 + 0.01 * rng.standard_normal())
    middle = np.array([lens.width - 1, lens.height - 1]) / 2 + rng.normal(0, 20, 2)
    bent = rng.normal(0, [0.006, 0.01, 0.0005, 0.0005, 0.003])
    lens.true = np.array([focal, focal, *middle, *bent])
    lens.stated = lens.true
    survey.camera_auto = {
        "make": "DJI",
        "model": "FC6310",
        "focal_mm": 8.8,
        "equivalent_mm": 24,
    }


def _stations(
    world: World, azimuth: float, along: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Aims (n, 2) about the scene's middle, headings (n,)."""
    count = world.photos
    across = np.array([along[1], -along[0]])
    if world.path == "single":
        side = np.pi / 2 * rng.choice([-1, 1])
        return rng.normal(0, 0.8, (1, 2)), np.array([azimuth + side])
    if world.path == "facing":
        heading = azimuth + np.pi / 2 + np.pi * np.arange(count)
        return rng.normal(0, 0.8, (count, 2)), heading + rng.normal(0, 0.2, count)
    there = (count + 1) // 2
    reach = 0.46 if world.size_m[0] > 100 else 0.3
    half = np.linspace(-reach, reach, there) * world.size_m[0]
    back = np.linspace(reach, -reach, max(2, count - there))[: count - there] * world.size_m[0]
    aside = np.r_[np.full(there, 2.0), np.full(count - there, -2.0)]
    aims = np.outer(np.r_[half, back], along) + np.outer(aside, across)
    headings = azimuth + np.r_[np.zeros(there), np.full(count - there, np.pi)]
    return aims + rng.normal(0, 0.6, (count, 2)), headings + rng.normal(0, 0.05, count)


def _fly(
    survey: Survey, world: World, azimuth: float, along: Floats, rng: np.random.Generator
) -> None:
    """Place the photos, and write what the autopilot says of them."""
    tilt = np.radians(rng.uniform(*world.tilt_deg))
    height = rng.uniform(*world.height_m)
    aims, headings = _stations(world, azimuth, along, rng)
    toward = np.column_stack([np.sin(headings), np.cos(headings)])
    places = survey.ground.middle + aims - height * np.tan(tilt) * toward
    ups = survey.ground.up(survey.ground.middle + aims) + height + rng.normal(0, 0.3, len(aims))
    at = np.column_stack([places, ups])
    exposure = EVERY_S * np.arange(1.0, len(at) + 1)
    nodes = np.r_[0.0, exposure, exposure[-1] + EVERY_S]
    track = np.vstack([2 * at[0] - at[min(1, len(at) - 1)], at, 2 * at[-1] - at[-2:][0]])
    hold = np.r_[exposure - 1, exposure + 1]
    order = np.argsort(hold)
    yaws = np.unwrap(np.r_[headings, headings][order])
    sway = Wander(rng, np.radians([1.5, 1.5, 0.5]), 2.0)

    def position(time: Floats) -> Floats:
        return np.column_stack([np.interp(time, nodes, column) for column in track.T])

    def attitude(time: Floats) -> Floats:
        yaw = np.interp(time, hold[order], yaws)
        return np.asarray(sway(time) + np.column_stack([0 * yaw, 0 * yaw, yaw]))

    boresight, lever = np.radians(1.2) * rng.standard_normal(3), 0.06 * rng.standard_normal(3)
    for rpy, place in zip(attitude(exposure), position(exposure), strict=True):
        body = body_turn(*rpy)
        turn = body @ mount_turn(tilt - np.pi / 2) @ turn_of(boresight)
        survey.poses.append(Pose(center=place + body @ lever, rotation=turn))
    if world.log is None:
        return
    time = np.arange(0.0, nodes[-1], 0.1)
    rtk = world.log == "rtk"
    size = np.array([0.01, 0.01, 0.02] if rtk else [0.35, 0.35, 0.35])
    bias = rng.standard_normal(3) * ([0.008, 0.008, 0.015] if rtk else [1.5, 1.5, 2.0])
    written = position(time) + bias + Wander(rng, size, 4.0 if rtk else 15.0)(time)
    tilted = Wander(rng, np.radians([0.7, 0.7, 1.3]), 15.0)(time)
    tilted[:, 2] += np.radians(1.3) * rng.standard_normal()
    accuracy = (0.014, 0.02) if rtk else (0.6, 0.9)
    survey.log = Log(
        time=time,
        position=written,
        rpy=attitude(time) + tilted,
        fix=6 if rtk else 3,
        accuracy_m=accuracy,
    )
    survey.photo_time_s = np.asarray(exposure + 0.03 * rng.standard_normal())
    survey.options["mount"] = {"gimbal": "none", "pitch_deg": float(np.degrees(tilt)) - 90.0}
    survey.options["time"] = {
        "source": "filename",
        "filename_format": "%Y%m%d_%H%M%S_%f",
        "offset_s": 0.0,
        "offset_sigma_s": CLOCK_SIGMA_S,
    }


def _tape(survey: Survey, world: World, labels: list[str], rng: np.random.Generator) -> None:
    """Tape lengths between labels that are picked; no two the same."""
    wanted = int(rng.integers(world.lengths[0], world.lengths[1] + 1))
    pairs = [(a, b) for k, a in enumerate(labels) for b in labels[:k]]
    scale = 1 + world.tape_scale * rng.standard_normal()
    used: dict[str, int] = dict.fromkeys(labels, 0)
    order = [pairs[k] for k in rng.permutation(len(pairs))]
    while len(survey.lines) < wanted and order:
        fresh = min(order, key=lambda pair: used[pair[0]] + used[pair[1]])  # stable
        order.remove(fresh)
        length = true_length(survey, fresh)
        if not 3.5 < length < 30.0 and not (world.size_m[0] > 100 and length < 45.0):
            continue
        for label in fresh:
            used[label] += 1
        read = length * scale + LINE_SIGMA_M * rng.standard_normal()
        if world.rounded_m:
            read = round(read / world.rounded_m) * world.rounded_m
        name = f"L{len(survey.lines) + 1}"
        survey.lines.append(Line(name=name, ends=fresh, length=read, sigma=LINE_SIGMA_M))


def true_length(survey: Survey, ends: tuple[str, str]) -> float:
    """Distance between two meant points."""
    return float(np.linalg.norm(survey.meant[ends[0]] - survey.meant[ends[1]]))


def _spoil_a_little(survey: Survey, rng: np.random.Generator) -> None:
    """Errors of three to five sigmas in a few observations."""
    for pick in rng.choice(np.array(survey.picks, dtype=object), 2, replace=False):
        pick.at = pick.at + 4.0 * turn_of(np.array([0, 0, rng.uniform(0, 6.3)]))[:2, 0]
    line = survey.lines[int(rng.integers(len(survey.lines)))]
    line.length += 0.025 * rng.choice([-1, 1])


def _measure(
    survey: Survey, labels: list[str], raised: list[str], rng: np.random.Generator
) -> None:
    """Ask for distances, areas, angles, line distances, heights between picked labels."""
    near = [
        (a, b)
        for k, a in enumerate(labels)
        for b in labels[:k]
        if 2.0 < true_length(survey, (a, b)) < 40.0
    ]
    for k, row in enumerate(rng.permutation(len(near))[:6]):
        survey.measure.append((f"D{k}", "distance", near[row]))
    ground = [label for label in labels if label not in raised]
    for kind, count, asked in (("area", 4, 2), ("angle", 3, 2), ("line_distance", 3, 2)):
        found = 0
        for _ in range(400):
            if found == asked or len(ground) < count:
                break
            some = tuple(str(label) for label in rng.choice(ground, count, replace=False))
            if kind == "area":
                some = _around(survey, some)
            if _is_sound(survey, kind, some):
                survey.measure.append((f"{kind}{found}", kind, some))
                found += 1
    for k, label in enumerate(raised):
        survey.measure.append((f"height{k}", "height", (label,)))
    for k, (a, b) in enumerate(pairwise(raised)):
        survey.measure.append((f"vertical{k}", "vertical_distance", (a, b)))


def _around(survey: Survey, labels: tuple[str, ...]) -> tuple[str, ...]:
    """Labels in order about their middle."""
    places = np.array([survey.meant[label][:2] for label in labels])
    east, north = (places - places.mean(axis=0)).T
    return tuple(labels[k] for k in np.argsort(np.arctan2(north, east)))


def _is_sound(survey: Survey, kind: str, labels: tuple[str, ...]) -> bool:
    """Whether a shape is one that people measure: neither thin nor huge."""
    p = np.array([survey.meant[label][:2] for label in labels])
    sides = np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1)
    if sides.max() > 60.0:
        return False
    if kind == "area":
        east, north = (p - p.mean(axis=0)).T
        area = abs(east @ np.roll(north, 1) - north @ np.roll(east, 1)) / 2
        return bool(area > 0.12 * sides.sum() ** 2 / 4)
    one, two = p[0] - p[1], p[2] - p[1]
    lengths = np.linalg.norm(one), np.linalg.norm(two)
    if min(lengths) < 3.0:
        return False
    sine = abs(one[0] * two[1] - one[1] * two[0]) / (lengths[0] * lengths[1])
    return bool(sine > 0.25 and sine * lengths[0] > 1.0)
