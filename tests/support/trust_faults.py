"""Single faults that people make, and the codes of causes that name each rightly."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from trust_conditions import World, draw, true_length
from trust_world import Line, Pick, Survey

FOOT_M = 0.3048
ALL = ("single", "single_no_log", "strip", "strip_no_log")
SEVERAL_PHOTOS = ("strip", "strip_no_log")
WITH_LOG = ("single", "strip")
ACCUSATIONS = (
    "line",
    "lines",
    "length",
    "lengths",
    "known",
    "pick",
    "label",
    "labels",
    "photo",
    "frame",
    "control",
    "point",
    "other",
    "mount",
    "gimbal",
    "clock",
    "log",
    "camera",
    "tape",
    "tapes",
)
"""First words of codes that say which observation, photo or setting is wrong,"""
NO_ACCUSATIONS = (
    "line-unseen",
    "label-unseen",
    "lengths-contradict",
    "log-note",
    "camera-assumed",
    "camera-unknown",
    "camera-sigma-assumed",
    "camera-sigma-from-file",
    "camera-exact",
    "camera-learnt",
    "camera-not-learnt",
)
"""but for these."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What is wrong.

    Attributes
    ----------
    plant
        Puts it into a survey.
    causes
        Codes that name it; one that ends in a hyphen stands for all that begin so.
    bases
        Surveys that can have it.
    world
        What is different in the survey.
    """

    plant: Callable[[Survey, np.random.Generator], None]
    causes: tuple[str, ...]
    bases: tuple[str, ...] = ALL
    world: Mapping[str, Any] = field(default_factory=dict)

    def changed(self, base: World) -> World:
        """The survey before the fault."""
        return replace(base, **self.world)


def accepts(fault: str, cause: str) -> bool:
    """Whether a cause names the fault."""
    return any(
        cause.startswith(code) if code.endswith("-") else cause == code
        for code in FAULTS[fault].causes
    )


def is_accusation(cause: str) -> bool:
    """Whether a cause says which observation, photo or setting is wrong."""
    return cause.split("-", 1)[0] in ACCUSATIONS and cause not in NO_ACCUSATIONS


def accused_rightly(reason: Mapping[str, Any], wrong: Mapping[str, Iterable[str]]) -> bool:
    """Whether any observation that a reason accuses is wrong.

    Beside the accused a reason names others that are at hand: the ends of a length that is blamed.
    """
    cause = reason["cause"]
    if "setting" in wrong and not cause.startswith(("line-", "pick-", "label")):
        return True
    kinds: tuple[str, ...] = ("frames", "labels", "lengths")
    if cause.startswith(("line", "tape", "known")):
        kinds = ("lengths",)
    elif cause.startswith(("pick", "label", "point", "control")):
        kinds = ("labels",)
    elif cause.startswith(("photo", "frame")):
        kinds = ("frames",)
    accused = [kind for kind in kinds if reason[kind]]
    if not accused:
        return bool(wrong)
    return any(set(reason[kind]) & set(wrong.get(kind, ())) for kind in accused)


# --- picks --------------------------------------------------------------------------------------


def gross_pick(least: float, most: float) -> Callable[[Survey, np.random.Generator], None]:
    """Move one pick by so many pixels."""

    def plant(survey: Survey, rng: np.random.Generator) -> None:
        pick = _pick(survey, rng)
        turn = rng.uniform(0, 2 * np.pi)
        far = np.exp(rng.uniform(np.log(least), np.log(most)))
        pick.at = pick.at + far * np.array([np.cos(turn), np.sin(turn)])
        pick.at = np.clip(pick.at, 1, [survey.lens.width - 2, survey.lens.height - 2])
        _blame_pick(survey, pick)

    return plant


def swapped_once(survey: Survey, rng: np.random.Generator) -> None:
    """Exchange two labels in one photo."""
    one = _pick(survey, rng)
    others = [p for p in survey.picks if p.photo == one.photo and p.label != one.label]
    two = others[int(rng.integers(len(others)))]
    one.label, two.label = two.label, one.label
    _blame_pick(survey, one)
    _blame_pick(survey, two)
    survey.redundant = all(_is_checked(survey, p.label, p.photo) for p in (one, two))


def swapped_everywhere(survey: Survey, rng: np.random.Generator) -> None:
    """Exchange two taped labels in all photos."""
    taped = sorted({end for line in survey.lines for end in line.ends})
    one, two = (str(x) for x in rng.choice(taped, 2, replace=False))
    other = {one: two, two: one}
    for pick in survey.picks:
        pick.label = other.get(pick.label, pick.label)
    survey.blame(labels=other)
    lengths = [line.name for line in survey.lines if set(line.ends) & set(other)]
    survey.blame(lengths=lengths)
    survey.redundant = all(sum(label in x.ends for x in survey.lines) > 1 for label in other)


def renamed(survey: Survey, rng: np.random.Generator) -> None:
    """Give one pick the name of another label, which the photo then lacks."""
    one = _pick(survey, rng)
    others = sorted(set(survey.picked) - {one.label})
    name = str(rng.choice([o for o in others if any(p.label == o for p in survey.picks)]))
    survey.picks = [
        p for p in survey.picks if p is one or not (p.photo == one.photo and p.label == name)
    ]
    survey.blame(labels=[one.label])
    one.label = name
    _blame_pick(survey, one)
    _drop_unpicked(survey)


def raised(survey: Survey, rng: np.random.Generator) -> None:
    """State a height of 0.4 to 1.2 m for a label on the ground."""
    label = _label(survey, rng)
    height = rng.uniform(0.4, 1.2)
    for pick in survey.picks:
        if pick.label == label:
            pick.extra |= {"height_m": round(height, 2), "height_sigma_m": 0.02}
    survey.blame(labels=[label])
    survey.redundant = _is_checked(survey, label)


# --- photos -------------------------------------------------------------------------------------


def _changed_photo(
    change: Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray], *, all_photos: bool
) -> Callable[[Survey, np.random.Generator], None]:
    def plant(survey: Survey, rng: np.random.Generator) -> None:
        photos = sorted({p.photo for p in survey.picks})
        chosen = photos if all_photos else [photos[int(rng.integers(len(photos)))]]
        most = np.array([survey.lens.width - 1.0, survey.lens.height - 1.0])
        for pick in survey.picks:
            if pick.photo in chosen:
                pick.at = change(pick.at, most, rng)
                survey.blame(labels=[pick.label])
        survey.blame(frames=[survey.photo(k) for k in chosen])
        if all_photos:
            survey.blame(setting=["photos"])

    return plant


def _mirror(at: np.ndarray, most: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return np.array([most[0] - at[0], at[1]])


def _half_turn(at: np.ndarray, most: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return np.asarray(most - at)


def _elsewhere(at: np.ndarray, most: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    del at
    return np.asarray(rng.uniform(0.05, 0.95, 2) * most)


def _in_half_size(at: np.ndarray, most: np.ndarray, _: np.random.Generator) -> np.ndarray:
    del most
    return np.asarray((at + 0.5) / 2.0 - 0.5)


# --- lengths ------------------------------------------------------------------------------------


def one_length(
    read: Callable[[float, np.random.Generator], float],
) -> Callable[[Survey, np.random.Generator], None]:
    """Change the reading of one length."""

    def plant(survey: Survey, rng: np.random.Generator) -> None:
        line = survey.lines[int(rng.integers(len(survey.lines)))]
        line.length = read(line.length, rng)
        _blame_line(survey, line)

    return plant


def readings_exchanged(survey: Survey, rng: np.random.Generator) -> None:
    """Write the readings of two lengths in each other's row."""
    pairs = [
        (one, other)
        for k, one in enumerate(survey.lines)
        for other in survey.lines[:k]
        if abs(one.length - other.length) > 0.7
    ]
    one, other = pairs[int(rng.integers(len(pairs)))]
    one.length, other.length = other.length, one.length
    survey.blame(lengths=[one.name, other.name])


def _in_feet(length: float, _: np.random.Generator) -> float:
    return length / FOOT_M


def _some_percent(length: float, rng: np.random.Generator) -> float:
    return float(length * (1 + rng.choice([-1, 1]) * rng.uniform(0.07, 0.4)))


def _metres_short(length: float, rng: np.random.Generator) -> float:
    return float(length - min(rng.uniform(0.5, 2.0), 0.6 * length))


def _digits_exchanged(length: float, rng: np.random.Generator) -> float:
    digits = f"{length:.2f}".replace(".", "")
    found = []
    for k in range(len(digits) - 1):
        other = [*digits]
        other[k], other[k + 1] = other[k + 1], other[k]
        value = int("".join(other)) / 100
        if 0.08 < abs(value - length) < 0.8 * length:
            found.append(value)
    return float(rng.choice(found)) if found else length + 0.9


def all_lengths(
    factor: float = 1.0, offset_m: float = 0.0
) -> Callable[[Survey, np.random.Generator], None]:
    """Change all lengths alike."""

    def plant(survey: Survey, rng: np.random.Generator) -> None:
        del rng
        for line in survey.lines:
            line.length = line.length * factor + offset_m
        survey.blame(lengths=[line.name for line in survey.lines], setting=["lengths"])
        survey.redundant = factor != 1.0 and survey.log is not None

    return plant


def level_tapes(survey: Survey, rng: np.random.Generator) -> None:
    """Hold the tape level on a slope, and do not say so."""
    for line in survey.lines:
        across = survey.meant[line.ends[1]][:2] - survey.meant[line.ends[0]][:2]
        line.length = float(np.linalg.norm(across)) + 0.01 * rng.standard_normal()
    survey.blame(lengths=[line.name for line in survey.lines], setting=["lengths"])
    survey.redundant = False


def wrong_end(survey: Survey, rng: np.random.Generator) -> None:
    """Name another label as one end of a length."""
    line = survey.lines[int(rng.integers(len(survey.lines)))]
    kept = line.ends[int(rng.integers(2))]
    picked = sorted({p.label for p in survey.picks} - set(line.ends))
    far = [other for other in picked if abs(true_length(survey, (kept, other)) - line.length) > 0.7]
    line.ends = (kept, str(rng.choice(far)))
    _blame_line(survey, line)


# --- settings -----------------------------------------------------------------------------------


def control_shifted(survey: Survey, rng: np.random.Generator) -> None:
    """Move one control point by 0.6 to 3 m."""
    label = str(rng.choice(sorted(survey.control)))
    turn, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.6, 3.0)
    survey.control[label] = survey.control[label] + far * np.array([np.cos(turn), np.sin(turn), 0])
    survey.blame(labels=[label])


def control_exchanged(survey: Survey, rng: np.random.Generator) -> None:
    """Write the coordinates of two control points in each other's row."""
    one, other = (str(x) for x in rng.choice(sorted(survey.control), 2, replace=False))
    survey.control |= {one: survey.control[other], other: survey.control[one]}
    survey.blame(labels=[one, other])


def clock_wrong(survey: Survey, rng: np.random.Generator) -> None:
    """Set the camera's clock 2 to 5 s wrong, one way or the other."""
    survey.photo_time_s = survey.photo_time_s + rng.choice([-1, 1]) * rng.uniform(2.0, 3.5)
    survey.blame(setting=["clock"], frames=[survey.photo(k) for k in range(len(survey.poses))])


def mount_wrong(survey: Survey, rng: np.random.Generator) -> None:
    """State the camera's mount 12 to 25 degrees wrong, or turned by a quarter."""
    mount = survey.options["mount"]
    if rng.random() < 0.3:
        mount["yaw_deg"] = 90.0
    else:
        mount["pitch_deg"] = mount["pitch_deg"] + rng.uniform(12, 25)
    survey.blame(setting=["mount"], frames=[survey.photo(k) for k in range(len(survey.poses))])


# --- choices ------------------------------------------------------------------------------------


def _pick(survey: Survey, rng: np.random.Generator) -> Pick:
    """A pick, in half of the surveys of a taped label."""
    taped = {end for line in survey.lines for end in line.ends}
    measured = {label for _, _, labels in survey.measure for label in labels}
    wanted = taped if rng.random() < 0.5 else measured - taped
    some = [p for p in survey.picks if p.label in wanted] or survey.picks
    return some[int(rng.integers(len(some)))]


def _label(survey: Survey, rng: np.random.Generator) -> str:
    return _pick(survey, rng).label


def _blame_pick(survey: Survey, pick: Pick) -> None:
    survey.blame(labels=[pick.label], frames=[survey.photo(pick.photo)])
    survey.redundant = _is_checked(survey, pick.label, pick.photo)


def _blame_line(survey: Survey, line: Line) -> None:
    survey.blame(lengths=[line.name])


def _is_checked(survey: Survey, label: str, photo: int = -1) -> bool:
    """Whether other photos show a label twice, or two lengths and more end at it."""
    others = {p.photo for p in survey.picks if p.label == label} - {photo}
    lengths = sum(label in line.ends for line in survey.lines)
    return len(others) >= 2 or lengths >= 3


def _drop_unpicked(survey: Survey) -> None:
    """Take out what names a label that nobody picked any more."""
    picked = {p.label for p in survey.picks}
    survey.lines = [line for line in survey.lines if set(line.ends) <= picked]
    survey.measure = [row for row in survey.measure if set(row[2]) <= picked]


# --- table --------------------------------------------------------------------------------------

_PICK = ("pick-", "label-elsewhere", "label-suspect")
_SWAP = ("labels-swapped", "labels-swapped-everywhere", *_PICK)
_LINE = ("line-", "lines-exchanged")
_PHOTO = (
    "photo-mirrored",
    "photo-turned",
    "photo-elsewhere",
    "photo-picked-in-copy",
    "frame-left-out",
)
_TAPES = ("lengths-factor", "lengths-offset", "lengths-wrong-unit", "lengths-", "tape-", "tapes-")
_HEIGHT = ("point-off-ground", "height-", "heights-", *_PICK)

FAULTS: dict[str, Fault] = {
    "pick_15_60px": Fault(plant=gross_pick(15, 60), causes=(*_PICK, "point-off-ground")),
    "pick_60_400px": Fault(plant=gross_pick(60, 400), causes=_PICK),
    "swapped_once": Fault(plant=swapped_once, causes=_SWAP),
    "swapped_all": Fault(plant=swapped_everywhere, causes=_SWAP, bases=SEVERAL_PHOTOS),
    "label_renamed": Fault(plant=renamed, causes=_SWAP),
    "height_wrong": Fault(plant=raised, causes=_HEIGHT),
    "photo_mirrored": Fault(
        plant=_changed_photo(_mirror, all_photos=False), causes=_PHOTO, bases=SEVERAL_PHOTOS
    ),
    "all_mirrored": Fault(
        plant=_changed_photo(_mirror, all_photos=True), causes=(*_PHOTO, "photos-mirrored")
    ),
    "photo_turned": Fault(
        plant=_changed_photo(_half_turn, all_photos=False), causes=_PHOTO, bases=SEVERAL_PHOTOS
    ),
    "photo_elsewhere": Fault(
        plant=_changed_photo(_elsewhere, all_photos=False), causes=_PHOTO, bases=SEVERAL_PHOTOS
    ),
    "photo_half_size": Fault(
        plant=_changed_photo(_in_half_size, all_photos=False),
        causes=(*_PHOTO, "other-camera"),
        bases=SEVERAL_PHOTOS,
    ),
    "length_percent": Fault(plant=one_length(_some_percent), causes=_LINE),
    "length_2m_short": Fault(plant=one_length(_metres_short), causes=_LINE),
    "length_in_feet": Fault(plant=one_length(_in_feet), causes=_LINE),
    "length_digits": Fault(plant=one_length(_digits_exchanged), causes=_LINE),
    "length_wrong_end": Fault(plant=wrong_end, causes=_LINE),
    "readings_exchanged": Fault(plant=readings_exchanged, causes=_LINE),
    "all_in_feet": Fault(plant=all_lengths(factor=1 / FOOT_M), causes=_TAPES),
    "all_hook_10cm": Fault(plant=all_lengths(offset_m=0.1), causes=_TAPES),
    "level_tapes": Fault(
        plant=level_tapes,
        causes=(*_TAPES, "ground-slopes", "level-on-slope"),
        world={"slope": (0.15, 0.01)},
    ),
    "control_shifted": Fault(
        plant=control_shifted,
        causes=("control-",),
        bases=WITH_LOG,
        world={"control": 4},
    ),
    "control_exchanged": Fault(
        plant=control_exchanged,
        causes=("control-",),
        bases=SEVERAL_PHOTOS,
        world={"control": 4},
    ),
    "clock_wrong": Fault(
        plant=clock_wrong, causes=("clock-off", "clock-", "time-"), bases=("strip",)
    ),
    "mount_wrong": Fault(
        plant=mount_wrong, causes=("mount-turned", "gimbal-off", "mount-"), bases=WITH_LOG
    ),
}


def draw_small(seed: int) -> tuple[str, Survey]:
    """Draw a survey of one to six photos, as people have them; two of three have a fault.

    Returns
    -------
    The fault, empty for none; and the survey.
    """
    rng = np.random.default_rng([977, seed])
    photos = int(rng.choice([1, 1, 2, 2, 3, 6]))
    log = (None, "gps", "rtk")[rng.choice([0, 0, 1, 1, 2])]
    lengths = int(rng.integers(3 if log else 4, 8))
    tilt = float(rng.choice([2, 20, 40, 60]))
    clicks = int(rng.choice([1, 1, 1, 2]))
    path = "single"
    if photos > 1:
        path = str(rng.choice(["strip", "facing"])) if photos == 2 else "strip"
    height = float(rng.uniform(10, 40, 1)[0])
    world = World(
        photos=photos,
        path=path,
        height_m=(height, height),
        tilt_deg=(tilt, tilt + 8),
        log=log,
        lengths=(lengths, lengths),
        taped=(max(5, lengths), 9),
        marks=(3, 9),
        share=1.0 if photos < 3 else 0.85,
        clicks=clicks,
        identified_m=float(rng.choice([0.003, 0.01])),
        relief_m=float(rng.choice([0.005, 0.015])),
        size_m=(24.0, 14.0) if tilt < 50 else (16.0, 10.0),
        control=int(rng.choice([0, 0, 0, 4])),
    )
    fault = "" if seed % 3 == 0 else str(rng.choice(list(FAULTS)))
    if fault:
        one = FAULTS[fault]
        world = one.changed(world)
        if log is None and fault in {"clock_wrong", "mount_wrong", "control_shifted"}:
            world = replace(world, log="gps")
        if one.bases == SEVERAL_PHOTOS and photos == 1:
            world = replace(world, photos=2, path="strip")
        if fault == "clock_wrong":
            world = replace(world, photos=6, path="strip")
    survey = draw(world, rng)
    if fault:
        FAULTS[fault].plant(survey, rng)
    return fault, survey
