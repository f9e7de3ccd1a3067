"""The local world: where its origin lies on the earth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from uavgram.model.flight.log import HeightDatum


class Geodetic(NamedTuple):
    """A place on the earth: WGS 84, and its height above the datum that is said beside it."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True, kw_only=True)
class World:
    """Origin of the local east-north-up world.

    Attributes
    ----------
    origin
        Its place; None where nothing ties the world to the earth.
    height_datum
        ``msl`` or ``ellipsoid``.
    gauge
        ``world``: positions and headings mean something; ``plane``: only shape does (no
        telemetry, no control): z = 0 is the plane, the first frame stands above x = y = 0 and its
        image up is north.
    crs
        Projected coordinate system of maps and drawings, such as ``EPSG:32756``; None where
        nothing ties the world to the earth.
    undulation_m
        How high mean sea level lies above the ellipsoid there, as the flight log says; None where
        nothing says it.
    """

    origin: Geodetic | None
    height_datum: HeightDatum
    gauge: Literal["world", "plane"]
    crs: str | None = None
    undulation_m: float | None = None

    @property
    def ellipsoid_shift_m(self) -> float | None:
        """What to add to a height above the datum to have it above the WGS 84 ellipsoid [m].

        None where nobody knows: sea level is up to a hundred metres off the ellipsoid.
        """
        return 0.0 if self.height_datum == "ellipsoid" else self.undulation_m
