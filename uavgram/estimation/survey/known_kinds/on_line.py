"""Points on a line of known position."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.known_kinds.known_kind import AlikeThings, KnownKind, KnownResiduals
from uavgram.geometry.ground.conditions import compute_joint_covariance, compute_line_offsets
from uavgram.model.observations import ON_LINE, KnownThing


class OnLine(KnownKind):
    """Points that were picked somewhere on a line with known coordinates."""

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the offsets of the points from their line; all share the errors of its ends."""
        value, gradient, covariance = [], [], []
        for thing, world in zip(alike.things, alike.world, strict=True):
            line = thing.position
            assert line is not None  # noqa: S101  (of this kind)
            beside = compute_line_offsets(world, line.ends_m, upwards=line.has_height)
            k, axes = beside.value.shape
            by_point = np.zeros((k, axes, k, 3))
            by_point[np.arange(k), :, np.arange(k)] = beside.gradient
            # Covariance of all offsets: errors of the line's ends, shared, and its straightness.
            joint = compute_joint_covariance(beside.by_ends, line.sigma_m, line.straightness_m)
            value.append(beside.value.ravel())
            gradient.append(by_point.reshape(k * axes, k, 3))
            covariance.append(joint * (thing.sigma / line.across_m) ** 2)
        return KnownResiduals(np.array(value), np.array(gradient), covariance=np.array(covariance))

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the axes of all points."""
        del on_ground
        return len(thing.label) * (1 + (thing.position is not None and thing.position.has_height))

    def gives_scale(self, value: float) -> bool:
        """Return True: the known ends of the line determine the scale."""
        del value
        return True


LINE_OF_POSITION = OnLine(
    ON_LINE,
    "place of the line",
    "on a line of known position",
    needs="world",
    unplaced=(
        "no other observation places this survey on the map, and such lines are too few for it",
        "It takes three picked points on lines that are not all parallel (or the flight log, or "
        "two control points).",
    ),
)
