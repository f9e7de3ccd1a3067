"""Which frames see which known things whole, and the planes that follow from these together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.network import SeenLines, placing, seen_lines
from uavgram.estimation.first_poses.plane_search import KnownPlanes, search_known
from uavgram.estimation.first_poses.plane_things import SCALED, PlaneThing, row_count
from uavgram.estimation.first_poses.prior_gate import OUTSIDE
from uavgram.estimation.survey.known_kinds.kinds import ALL_KINDS
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.known import KnownThing
from uavgram.model.survey.survey import Survey

WORDS = {
    "length": ("length", "lengths"),
    "distance": ("length", "lengths"),
    "horizontal_distance": ("length", "lengths"),
    "polyline": ("length", "lengths"),
    "line_distance": ("distance from a line", "distances from a line"),
    "area": ("area", "areas"),
    "angle": ("angle", "angles"),
    "right_angle": ("right angle", "right angles"),
    "parallel": ("pair of parallel lines", "pairs of parallel lines"),
    "equal_lengths": ("pair of equal lengths", "pairs of equal lengths"),
}
"""What each kind is called, one and several."""


class FrameThings(NamedTuple):
    """Known lengths and things that a frame sees whole, on one level of the ground.

    Attributes
    ----------
    things
        With picks of the survey.
    number
        Of each among the project's known things; -1: a length of the table.
    rows
        How many numbers they say of the pose; lengths between the same two points count once.
    """

    things: tuple[PlaneThing, ...]
    number: tuple[int, ...]
    rows: int

    @property
    def scaled(self) -> bool:
        """Whether one of them says how large things are."""
        return any(one.kind in SCALED for one in self.things)

    def words(self) -> str:
        """What they are: "2 lengths and 1 right angle"."""
        number: Counter[tuple[str, str]] = Counter()
        for one in self.things:
            number[WORDS[one.kind]] += row_count(one.kind, len(one.pick))
        parts = [f"{n} {words[n > 1]}" for words, n in number.items()]
        return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def known_rows(survey: Survey) -> int:
    """How many numbers known things, but for lengths of the table, say of poses over the ground."""
    things = [one for one in survey.known if _says_something(survey, one)]
    return sum(row_count(one.kind, len(one.label)) for one in things)


def frame_things(survey: Survey) -> dict[int, FrameThings]:
    """What is known of the points of each frame that sees anything but lengths whole."""
    found = _seen_things(survey)
    if not found:
        return {}
    lines = seen_lines(survey)
    return {f: _with_lines(survey, lines, f, things) for f, things in sorted(found.items())}


def known_planes(
    survey: Survey, ray: Floats, seen: Mapping[int, FrameThings], without: Collection[int] = ()
) -> dict[int, KnownPlanes]:
    """Planes that lengths and other known things together allow, of frames that they determine.

    Parameters
    ----------
    survey
        The observations.
    ray
        (P, 3) undistorted rays of its picks, z = 1.
    seen
        As `frame_things` finds them.
    without
        Frames whose planes are known already.
    """
    sigma = survey.pick_sigma_px / survey.calibration.parameters[0]
    found = {}
    for frame, known in seen.items():
        if frame not in without and known.rows >= 3:
            planes = search_known(ray, sigma, known.things)
            if len(planes.plane):
                found[frame] = planes
    return found


def odd_ones_out(survey: Survey) -> frozenset[int]:
    """Numbers of known things without which alone all others of their frame agree.

    Only where they are enough to say so: the others determine a pose and check it.
    """
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    sigma = survey.pick_sigma_px / survey.calibration.parameters[0]
    odd = set()
    for known in frame_things(survey).values():
        if _agree(search_known(ray, sigma, known.things), known.things):
            continue
        without = {
            number: known.things[:k] + known.things[k + 1 :]
            for k, number in enumerate(known.number)
        }
        found = [n for n, rest in without.items() if _agree(search_known(ray, sigma, rest), rest)]
        odd |= set(found) if len(found) == 1 else set()
    return frozenset(odd - {-1})


def _agree(found: KnownPlanes, things: tuple[PlaneThing, ...]) -> bool:
    """Whether things determine a plane, check it, and fit it."""
    checks = sum(row_count(one.kind, len(one.pick)) for one in things) - 3
    return bool(checks > 0 and len(found.cost) and found.cost[0] <= chdtri(checks, OUTSIDE))


def _seen_things(survey: Survey) -> dict[int, list[tuple[int, PlaneThing]]]:
    """Known things with their numbers, but for the table's lengths, by frames that see them whole.

    The points must be on the ground, or stated to be equally high above it, in one area.
    """
    found: dict[int, list[tuple[int, PlaneThing]]] = {}
    for one in survey.known:
        if not _says_something(survey, one):
            continue
        picks = [
            dict(zip(survey.pick_frame[rows].tolist(), rows.tolist(), strict=True))
            for rows in (np.flatnonzero(survey.pick_label == k) for k in one.label)
        ]
        for frame in set(picks[0]).intersection(*picks[1:]):
            at = tuple(by_frame[frame] for by_frame in picks)
            value = one.value if ALL_KINDS[one.kind].has_value else 0.0
            thing = PlaneThing(one.kind, at, value, one.sigma)
            found.setdefault(frame, []).append((one.index, thing))
    return found


def _says_something(survey: Survey, thing: KnownThing) -> bool:
    """Whether a thing is of points at one level, and holds not on every plane alike."""
    label = list(thing.label)
    if thing.position is not None:  # where a frame stands, not how high above what plane
        return False
    level = all(len(set(of[label])) == 1 for of in (survey.area, survey.height_above_m))
    # In line: a distance of zero from a line, an angle of 0 or 180 degrees.
    in_line = ALL_KINDS[thing.kind].has_value and not 0.0 < thing.value < (
        180.0 if thing.kind == "angle" else np.inf
    )
    rows = row_count(thing.kind, len(label))
    return bool(rows and level and not in_line and placing(survey)[label].all())


def _with_lines(
    survey: Survey, lines: SeenLines, frame: int, things: list[tuple[int, PlaneThing]]
) -> FrameThings:
    """A frame's things and its known lengths; one pair of points says one number."""
    rows: Ints = np.flatnonzero(lines.frame == frame)
    known = [
        PlaneThing(
            "distance",
            (int(lines.start[k]), int(lines.end[k])),
            float(survey.length_m[lines.line[k]]),
            float(survey.length_sigma_m[lines.line[k]]),
        )
        for k in rows
    ]
    together = (*known, *(one for _, one in things))
    numbers = (*(-1 for _ in known), *(number for number, _ in things))
    different = {(WORDS[one.kind], frozenset(one.pick), one.pick[1:-1]): one for one in together}
    number = sum(row_count(one.kind, len(one.pick)) for one in different.values())
    return FrameThings(together, numbers, number)
