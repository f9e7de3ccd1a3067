"""Known azimuths: of a wall on a map, of a sight by compass, or the bearing of two points."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.known_kinds.known_kind import AlikeThings, KnownKind, KnownResiduals
from uavgram.model.observations import KnownThing


class Azimuth(KnownKind):
    """Direction in plan from a first point to a second, clockwise from north [deg].

    North is that of the world's axes, true north at the origin. The azimuth of a grid bearing is
    the bearing plus ``convergence_deg``, the angle by which grid north is east of true north.
    """

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute azimuths minus known ones, from -180 to 180 degrees; 0 if the points coincide."""
        known = [
            thing.value + dict(thing.parameters).get(CONVERGENCE, 0.0) for thing in alike.things
        ]
        ahead = alike.world[:, 1, :2] - alike.world[:, 0, :2]
        square = np.sum(ahead**2, axis=1)
        is_apart = square > 0.0
        azimuth = np.degrees(np.arctan2(ahead[:, 0], ahead[:, 1]))
        value = np.where(is_apart, (azimuth - known + 180.0) % 360.0 - 180.0, 0.0)
        # Gradient of atan2(east, north): (north, -east) / distance^2.
        turn = np.degrees(ahead[:, ::-1] * [1.0, -1.0] / np.where(is_apart, square, 1.0)[:, None])
        gradient = np.zeros((len(known), 1, 2, 3))
        gradient[:, 0, 0, :2], gradient[:, 0, 1, :2] = -turn, turn
        return KnownResiduals(value[:, None], gradient)

    def fault(self, value: float) -> str:
        """Describe why an azimuth is impossible."""
        return "" if 0.0 <= value < 360.0 else "must lie from 0 to less than 360 degrees"

    def adjusted(self, thing: KnownThing, off: float) -> float:
        """Return the adjusted azimuth, from 0 to less than 360 degrees."""
        return (thing.value + off) % 360.0


CONVERGENCE = "convergence_deg"

AZIMUTH = Azimuth(
    "azimuth",
    shown="azimuth",
    points=(2, 2),
    unit="deg",
    has_value=True,
    is_directed=True,
    parameters=(CONVERGENCE,),
    needs="world",
    unplaced=(
        "nothing else determines where north is",
        "It takes the flight log, two control points or three points on lines of known position.",
    ),
)
