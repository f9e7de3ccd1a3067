"""Surveys with one gross error of each kind, and how far measured values are from the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey
from uavgram.stages.refine.cleaned_adjustment import Robust

LOG: Mapping[str, Any] = {"frames": 4, "lines": 8, "labels": 14}
NO_LOG: Mapping[str, Any] = {**LOG, "telemetry": False, "gauge": "plane"}
FOOT_M = 0.3048
RAISED = 4
"""The label that is off the ground in scenes made for that."""


@dataclass(frozen=True)
class Wrong:
    """A survey with one gross error.

    Attributes
    ----------
    survey
        All observations.
    picks, lines, known, control, labels
        What is wrong: rows, or names of labels that are off the ground.
    """

    survey: Survey
    picks: frozenset[int] = frozenset()
    lines: frozenset[int] = frozenset()
    known: frozenset[int] = frozenset()
    control: frozenset[int] = frozenset()
    labels: frozenset[str] = frozenset()

    @property
    def what(self) -> tuple[frozenset[Any], ...]:
        """All of it, in the order of `left_out`."""
        return self.picks, self.lines, self.known, self.control, self.labels


def left_out(robust: Robust) -> tuple[frozenset[Any], ...]:
    """Picks, lengths, known things, control points and labels that are no part of the result."""
    refined = robust.refined
    return (
        frozenset(refined.pick_reason),
        frozenset(np.flatnonzero(refined.line_removed).tolist()),
        refined.known_removed,
        frozenset(robust.control.tolist()),
        frozenset(robust.labels),
    )


Fault = Callable[[Scene, np.random.Generator], Wrong]


def no_error(scene: Scene, _: np.random.Generator) -> Wrong:
    """Leave everything right."""
    return Wrong(scene.survey)


def pick_off(scene: Scene, rng: np.random.Generator) -> Wrong:
    """Move one pick of a point in three photos or more by 15 to 500 px."""
    survey = scene.survey
    often = np.bincount(survey.pick_label, minlength=len(survey.label))[survey.pick_label]
    pick, angle = int(rng.choice(np.flatnonzero(often > 2))), rng.uniform(0, 2 * np.pi)
    pixel = np.array(survey.pixel_px)
    pixel[pick] += np.exp(rng.uniform(np.log(15), np.log(500))) * np.array([
        np.cos(angle), np.sin(angle)
    ])  # fmt: skip
    return Wrong(replace(survey, pixel_px=pixel), picks=frozenset([pick]))


def length_of(change: Callable[[float, np.random.Generator], float]) -> Fault:
    """Change one length."""

    def fault(scene: Scene, rng: np.random.Generator) -> Wrong:
        length = np.array(scene.survey.length_m)
        line = int(rng.integers(len(length)))
        length[line] = change(float(length[line]), rng)
        return Wrong(replace(scene.survey, length_m=length), lines=frozenset([line]))

    return fault


def by_a_share(length: float, rng: np.random.Generator) -> float:
    """7 to 40 % too long or too short."""
    return float(length * (1 + rng.uniform(0.07, 0.4) * rng.choice([-1, 1])))


def two_metres_long(length: float, _: np.random.Generator) -> float:
    """The wrong end of the tape's first 2 m."""
    return length + 2.0


def known_off(scene: Scene, rng: np.random.Generator) -> Wrong:
    """State four distances, one of them 0.4 m wrong."""
    things = []
    wrong = int(rng.integers(4))
    for k in range(4):
        one, other = 2 * k, 2 * k + 1
        value = float(np.linalg.norm(scene.world[one] - scene.world[other]))
        value += 0.02 * rng.normal() + (0.4 if k == wrong else 0.0)
        things.append(
            KnownThing(
                index=k, name=f"d{k}", kind="distance", label=(one, other), value=value, sigma=0.02
            )
        )
    return Wrong(replace(scene.survey, known=tuple(things)), known=frozenset([wrong]))


def control_off(scene: Scene, rng: np.random.Generator) -> Wrong:
    """Move one of the control points by 1 to 40 m to a side."""
    world, angle = np.array(scene.survey.control_world_m), rng.uniform(0, 2 * np.pi)
    point = int(rng.integers(len(world)))
    world[point, :2] += rng.uniform(1, 40) * np.array([np.cos(angle), np.sin(angle)])
    return Wrong(replace(scene.survey, control_world_m=world), control=frozenset([point]))


def point_raised(scene: Scene, _: np.random.Generator) -> Wrong:
    """Keep silent that a point is off the ground."""
    none = np.zeros(len(scene.survey.label))
    name = scene.survey.label[RAISED]
    return Wrong(replace(scene.survey, height_above_m=none), labels=frozenset([name]))


def photo_of(change: Callable[[Floats, np.random.Generator], Floats]) -> Fault:
    """Change all picks of one photo."""

    def fault(scene: Scene, rng: np.random.Generator) -> Wrong:
        survey = scene.survey
        own = np.flatnonzero(survey.pick_frame == int(rng.integers(len(survey.frame_id))))
        pixel = np.array(survey.pixel_px)
        pixel[own] = change(pixel[own], rng)
        return Wrong(replace(survey, pixel_px=pixel), picks=frozenset(own.tolist()))

    return fault


def mirrored(pixel: Floats, _: np.random.Generator) -> Floats:
    """Left and right exchanged."""
    seen: Floats = np.array([1999.0, 0.0]) + pixel * np.array([-1.0, 1.0])
    return seen


def elsewhere(pixel: Floats, rng: np.random.Generator) -> Floats:
    """Picks of another place."""
    return rng.uniform([20, 20], [1980, 1480], pixel.shape)


def all_in_feet(scene: Scene, _: np.random.Generator) -> Wrong:
    """State all lengths in feet."""
    survey = scene.survey
    every = frozenset(range(len(survey.length_m)))
    return Wrong(replace(survey, length_m=survey.length_m / FOOT_M), lines=every)


FAULTS: Mapping[str, tuple[Fault, Mapping[str, Any]]] = {
    "nothing": (no_error, {}),
    "pick": (pick_off, {}),
    "length by a share": (length_of(by_a_share), {}),
    "length by 2 m": (length_of(two_metres_long), {}),
    "known thing": (known_off, {}),
    "point 1 m off the ground": (point_raised, {"heights": {RAISED: 1.0}}),
    "photo mirrored": (photo_of(mirrored), {}),
    "photo of another place": (photo_of(elsewhere), {}),
    "control point": (control_off, {"control": 4}),
    "all lengths in feet": (all_in_feet, {}),
}
"""Gross errors, and what scenes need for them."""

WITH_LOG_ONLY = ("control point", "all lengths in feet")


def survey_with(fault: str, base: Mapping[str, Any], seed: int) -> tuple[Scene, Wrong]:
    """A scene, and its survey with a gross error."""
    plant, needs = FAULTS[fault]
    scene = make_scene(seed, **{**base, **needs})
    return scene, plant(scene, np.random.default_rng(seed))


def largest_error(adjustment: Adjustment, scene: Scene, without: tuple[str, ...] = ()) -> float:
    """Of the distances between all points but some, in their sigmas."""
    label = [name for name in adjustment.survey.label if name not in without]
    count = len(label)
    world, covariance = adjustment.joint_points(adjustment.label_rows(label))
    truth = scene.world[[scene.survey.label.index(name) for name in label]]
    one, other = np.triu_indices(count, 1)
    along = world[one] - world[other]
    length = np.linalg.norm(along, axis=1)
    gradient = np.zeros((len(one), count, 3))
    pair = np.arange(len(one))
    gradient[pair, one], gradient[pair, other] = along / length[:, None], -along / length[:, None]
    rows = gradient.reshape(len(one), -1)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance, rows))
    wrong = length - np.linalg.norm(truth[one] - truth[other], axis=1)
    return float(np.abs(wrong / sigma).max())
