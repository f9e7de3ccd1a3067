"""Two picks of one photo that do not fit, of which each lies where the other belongs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from uavgram.geometry.camera.projection import project
from uavgram.model.arrays import Floats
from uavgram.model.message import Message, Several
from uavgram.model.result.tables import PickResults
from uavgram.stages.judge.tested_survey import TestedSurvey

MUCH_BETTER = 0.25
"""Distance of a pick from the other's place over that from its own, up to which it belongs there.
A pick that takes part pulls its own place along, so that the other's is not met in full."""


@dataclass(frozen=True)
class Swap:
    """Two labels of one photo that seem to be swapped.

    Attributes
    ----------
    frame, labels
        The photo, and the labels of the two picks.
    own_px, other_px
        How far each pick lies from where its label belongs, and from where the other one does.
    """

    frame: str
    labels: tuple[str, str]
    own_px: tuple[float, float]
    other_px: tuple[float, float]

    def message(self) -> Message:
        """What to do about it."""
        (a, b), (own_a, own_b), (other_a, other_b) = self.labels, self.own_px, self.other_px
        how = (
            f"each pick lies where the other belongs, {other_a:.1f} and {other_b:.1f} px away "
            f"instead of {own_a:.0f} and {own_b:.0f} px from its own place"
        )
        several = Several(
            "Labels seem to be swapped in {count} photos or pairs of picks",
            f"{a!r} and {b!r} in {self.frame!r}",
            ending="Each pick lies where the other belongs: look, and swap the labels there.",
        )
        return Message(
            "warning",
            "labels-swapped",
            f"The labels {a!r} and {b!r} seem to be swapped in {self.frame!r}: {how}. Look at "
            "both, and swap the labels in this photo.",
            frames=(self.frame,),
            labels=self.labels,
            several=several,
        )


def swapped_labels(examined: TestedSurvey, picks: PickResults) -> tuple[Swap, ...]:
    """Pairs of picks that are suspect or were taken out, and fit each other's place; best first."""
    odd: dict[str, list[int]] = {}
    known_label = {label: k for k, label in enumerate(examined.adjustment.survey.label)}
    known_frame = {name: k for k, name in enumerate(examined.adjustment.survey.frame_id)}
    for row, status in enumerate(picks.status):
        image = picks.image[row]
        if status != "used" and image in known_frame and picks.label[row] in known_label:
            odd.setdefault(image, []).append(row)
    found: list[Swap] = []
    for image, rows in odd.items():
        if len(rows) > 1:
            label = np.array([known_label[picks.label[row]] for row in rows])
            places = _places(examined, known_frame[image], label)
            found += _pairs(image, [picks.label[r] for r in rows], picks.pixel_px[rows], places)
    return tuple(found)


def _places(examined: TestedSurvey, frame: int, label: np.ndarray) -> Floats:
    """(n, 2) pixels at which labels should appear in a frame."""
    adjustment, state = examined.adjustment, examined.adjustment.state
    world, _, _ = adjustment.problem.world_points(state, label)
    camera = (world - state.center[frame]) @ state.rotation[frame]
    model = adjustment.survey.calibration.model
    return project(model, adjustment.problem.intrinsics(state), camera)


def _pairs(image: str, label: list[str], pixel: Floats, place: Floats) -> Iterator[Swap]:
    """Pairs of which each fits the other's place far better than its own, each pick once."""
    away = np.linalg.norm(pixel[:, None] - place[None], axis=2)  # of pick i from the place of j
    pairs = [
        (max(away[i, j] / away[i, i], away[j, i] / away[j, j]), i, j)
        for i, j in combinations(range(len(label)), 2)
        if label[i] != label[j] and away[i, i] > 0 and away[j, j] > 0
    ]
    taken: set[int] = set()
    for ratio, i, j in sorted(pairs):
        if ratio < MUCH_BETTER and not taken & {i, j}:
            taken |= {i, j}
            own, other = (away[i, i], away[j, j]), (away[i, j], away[j, i])
            yield Swap(
                image,
                (label[i], label[j]),
                (float(own[0]), float(own[1])),
                (float(other[0]), float(other[1])),
            )
