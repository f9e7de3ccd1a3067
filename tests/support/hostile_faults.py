"""What people do wrong with a survey, as changes of a made-up one before it is written.

Each fault takes a sound survey and says what it made wrong. It is chosen so that the survey can
show it at all: labels that several photos see, readings that really differ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np
from hostile_conditions import Condition
from hostile_surveys import PICK_SIGMA_PX, HostileSurvey, make_survey

from uavgram.model.arrays import Bools, Floats, Ints

SEEN = 3
"""Photos that show a label, from which on they can tell a wrong pick from a point in the air."""
TIME = "%Y%m%d_%H%M%S_%f"


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """Names of what is wrong; None: a message may speak of any."""

    frames: frozenset[str] | None = None
    labels: frozenset[str] | None = None
    lengths: frozenset[str] = frozenset()


class Sound(NamedTuple):
    """A survey without the fault, and what it was made from."""

    survey: HostileSurvey
    condition: Condition
    seed: int
    rng: np.random.Generator


@dataclass(frozen=True, kw_only=True, eq=False)
class Faulty:
    """A survey with a fault; `copies` are photos of the very same bytes: new name -> old one."""

    survey: HostileSurvey
    wrong: Wrong = field(default_factory=Wrong)
    copies: dict[str, str] = field(default_factory=dict)


Fault = Callable[[Sound], Faulty]


def none(sound: Sound) -> Faulty:
    """Nothing, or only what the condition does."""
    return Faulty(survey=sound.survey)


def swapped_once(sound: Sound) -> Faulty:
    """Two labels exchanged in one photo."""
    survey, first, second = _two_in_a_photo(sound)
    return _relabelled(survey, np.array([first, second]), survey.pick_label[[second, first]])


def clicked_elsewhere(sound: Sound, *, both: bool) -> Faulty:
    """One label clicked where another one is; the other one is there as well (`both`) or not."""
    survey, first, second = _two_in_a_photo(sound)
    pixel = survey.pick_px.copy()
    noise = PICK_SIGMA_PX * sound.rng.standard_normal(2)
    pixel[first] = pixel[second] + noise * np.sqrt(2)  # its own, and that of the true place
    wrong = Wrong(
        frames=_photos(survey, [first]), labels=_labels(survey.pick_label[[first, second]])
    )
    changed = replace(survey, pick_px=pixel)
    kept = np.ones(len(pixel), dtype=np.bool_)
    kept[second] = both
    return Faulty(survey=_with_picks(changed, kept), wrong=wrong)


def swapped_everywhere(sound: Sound, *, lengths: tuple[int, int]) -> Faulty:
    """Two labels exchanged in all photos.

    Parameters
    ----------
    sound
        The survey.
    lengths
        How many lengths end at one of the two and nowhere at the other: at least, at most. Where
        there is one, it could as well have been taped from the other label.
    """
    survey, rng = sound.survey, sound.rng
    ends = np.bincount(survey.line.ravel(), minlength=len(survey.world_m))
    for _ in range(1000):
        a, b = rng.choice(often_seen(survey), 2, replace=False)
        between = np.isin(survey.line, [a, b]).all(axis=1).sum()
        if lengths[0] <= ends[a] + ends[b] - 2 * between <= lengths[1]:
            break
    else:
        raise LookupError("no two labels with so many lengths")
    label = survey.pick_label.copy()
    label[survey.pick_label == a], label[survey.pick_label == b] = b, a
    touched = np.flatnonzero(np.isin(survey.line, [a, b]).any(axis=1) & (lengths[1] == 1))
    told = np.append(survey.line[touched].ravel(), [a, b])
    wrong = Wrong(labels=_labels(told), lengths=length_names(touched))
    return Faulty(survey=replace(survey, pick_label=label), wrong=wrong)


def gross_pick(sound: Sound, far_px: float) -> Faulty:
    """One pick so far off."""
    survey, rng = sound.survey, sound.rng
    pick = int(rng.choice(np.flatnonzero(_is_often_seen(survey))))
    azimuth = rng.uniform(0, 2 * np.pi)
    pixel = survey.pick_px.copy()
    pixel[pick] += far_px * np.array([np.cos(azimuth), np.sin(azimuth)])
    wrong = Wrong(frames=_photos(survey, [pick]), labels=_labels(survey.pick_label[[pick]]))
    return Faulty(survey=replace(survey, pick_px=pixel), wrong=wrong)


def raised_label(sound: Sound, from_m: float, to_m: float) -> Faulty:
    """A label stands off the ground, and nobody says so."""
    label = int(sound.rng.choice(often_seen(sound.survey)))
    above_m = float(sound.rng.uniform(from_m, to_m))
    condition = replace(sound.condition, raised=((label, above_m),))
    return Faulty(survey=make_survey(condition, sound.seed), wrong=Wrong(labels=_labels([label])))


def gimbal_turned(sound: Sound, roll_pitch_yaw_deg: tuple[float, float, float]) -> Faulty:
    """The log states the gimbal's angles with an error that stays the same."""
    survey = sound.survey
    assert survey.log is not None
    angles = survey.log.gimbal_rpy_rad + np.deg2rad(roll_pitch_yaw_deg)
    return Faulty(survey=replace(survey, log=replace(survey.log, gimbal_rpy_rad=angles)))


def clock_late(sound: Sound, by_s: float) -> Faulty:
    """The camera's clock runs late: far more than is stated of it."""
    moved = tuple(_later(name, by_s) for name in sound.survey.photo)
    return Faulty(survey=replace(sound.survey, photo=moved))


def other_zoom(sound: Sound, photos: int, zoom: float) -> Faulty:
    """So many photos were taken at another zoom."""
    twin = make_survey(replace(sound.condition, zoom=zoom), sound.seed)
    return _photos_of(sound, twin, photos)


def other_place(sound: Sound) -> Faulty:
    """One photo is of another place: its picks are where that place happens to have the labels."""
    return _photos_of(sound, make_survey(sound.condition, sound.seed + 1_000_003), 1)


def turned_photo(sound: Sound, turn: Callable[[Floats, tuple[int, int]], Floats]) -> Faulty:
    """One photo was picked on a turned image."""
    survey = sound.survey
    frame = _busy(sound)
    rows = survey.pick_photo == frame
    pixel = survey.pick_px.copy()
    pixel[rows] = turn(pixel[rows], (survey.camera.width_px, survey.camera.height_px))
    size = np.array([survey.camera.width_px, survey.camera.height_px])
    kept = np.asarray(((pixel >= 0) & (pixel < size)).all(axis=1))
    wrong = Wrong(frames=frozenset({f"{survey.photo[frame]}.jpg"}))
    return Faulty(survey=_with_picks(replace(survey, pick_px=pixel), kept), wrong=wrong)


def mirrored(pixel: Floats, size: tuple[int, int]) -> Floats:
    """Left is right."""
    return np.asarray(pixel * [-1, 1] + [size[0] - 1, 0])


def upside_down(pixel: Floats, size: tuple[int, int]) -> Floats:
    """By 180 degrees."""
    return np.asarray(np.array(size) - 1 - pixel)


def quarter_turn(pixel: Floats, size: tuple[int, int]) -> Floats:
    """By 90 degrees, clockwise; what then lies beyond the image's edge cannot be picked."""
    return np.column_stack([size[1] - 1 - pixel[:, 1], pixel[:, 0]])


def photo_twice(sound: Sound) -> Faulty:
    """The file of a photo is there twice, picked twice."""
    survey = sound.survey
    frame = _busy(sound)
    copy = _later(survey.photo[frame], 0.01)
    rows = np.flatnonzero(survey.pick_photo == frame)
    twice = replace(
        survey,
        photo=(*survey.photo, copy),
        pick_photo=np.append(survey.pick_photo, np.full(len(rows), len(survey.photo))),
        pick_label=np.append(survey.pick_label, survey.pick_label[rows]),
        pick_px=np.concatenate([survey.pick_px, survey.pick_px[rows]]),
    )
    return Faulty(survey=twice, copies={copy: survey.photo[frame]})


def _two_in_a_photo(sound: Sound) -> tuple[HostileSurvey, int, int]:
    """Two picks of one photo, of labels that others see too."""
    survey, rng = sound.survey, sound.rng
    often = _is_often_seen(survey)
    count = np.bincount(survey.pick_photo[often], minlength=len(survey.photo))
    frame = rng.choice(np.flatnonzero(count >= 2))
    one, other = rng.choice(np.flatnonzero(often & (survey.pick_photo == frame)), 2, replace=False)
    return survey, int(one), int(other)


def _busy(sound: Sound) -> int:
    """One of the photos with at least half as many picks as the busiest, but not the first."""
    count = np.bincount(sound.survey.pick_photo)
    return int(sound.rng.choice(np.flatnonzero(2 * count >= count.max())))


def _photos_of(sound: Sound, twin: HostileSurvey, photos: int) -> Faulty:
    """The survey with the picks that another one has in some photos, by their order."""
    survey = sound.survey
    usable = [k for k in range(len(survey.photo)) if (twin.pick_photo == k).sum() > SEEN]
    chosen = sound.rng.choice(usable, photos, replace=False)
    own = ~np.isin(survey.pick_photo, chosen)
    theirs = np.isin(twin.pick_photo, chosen) & np.isin(twin.pick_label, survey.pick_label[own])
    mixed = replace(
        survey,
        pick_photo=np.append(survey.pick_photo[own], twin.pick_photo[theirs]),
        pick_label=np.append(survey.pick_label[own], twin.pick_label[theirs]),
        pick_px=np.concatenate([survey.pick_px[own], twin.pick_px[theirs]]),
    )
    return Faulty(
        survey=mixed, wrong=Wrong(frames=frozenset(f"{survey.photo[k]}.jpg" for k in chosen))
    )


def _relabelled(survey: HostileSurvey, pick: Ints, to: Ints) -> Faulty:
    label = survey.pick_label.copy()
    label[pick] = to
    wrong = Wrong(frames=_photos(survey, pick), labels=_labels(to))
    return Faulty(survey=replace(survey, pick_label=label), wrong=wrong)


def _with_picks(survey: HostileSurvey, kept: Bools) -> HostileSurvey:
    return replace(
        survey,
        pick_photo=survey.pick_photo[kept],
        pick_label=survey.pick_label[kept],
        pick_px=survey.pick_px[kept],
    )


def _is_often_seen(survey: HostileSurvey) -> Bools:
    """(p,) picks of labels that at least SEEN photos show."""
    return np.asarray(np.bincount(survey.pick_label)[survey.pick_label] >= SEEN)


def often_seen(survey: HostileSurvey) -> Ints:
    return np.unique(survey.pick_label[_is_often_seen(survey)])


def _photos(survey: HostileSurvey, picks: Ints | list[int]) -> frozenset[str]:
    return frozenset(f"{survey.photo[k]}.jpg" for k in survey.pick_photo[picks])


def _labels(labels: Ints | list[int]) -> frozenset[str]:
    return frozenset(f"P{k}" for k in labels)


def length_names(lines: Ints | list[int] | range) -> frozenset[str]:
    return frozenset(f"L{k}" for k in lines)


def _later(name: str, by_s: float) -> str:
    moment = datetime.strptime(name, TIME) + timedelta(seconds=by_s)  # noqa: DTZ007
    return f"{moment:%Y%m%d_%H%M%S_%f}"
