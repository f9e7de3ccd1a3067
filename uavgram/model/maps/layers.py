"""What a survey looks like on the ground: shapes with attributes, for maps and drawings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight.log import HeightDatum
from uavgram.model.maps.profile_sheet import ProfileSheet

ShapeKind = Literal["point", "line", "polygon"]
Attribute = tuple[str, ...] | tuple[float, ...]


HIDDEN = ("footprints", "ellipses_95")
"""Layers that files hide at first; the ellipses are metres wide by the receiver's bias."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Shapes of one kind with the same attributes.

    Attributes
    ----------
    name
        Such as ``measurements``; plain letters, as files and tables name it.
    kind
        What every shape is.
    vertices_m
        N arrays (v, 3) of east, north, up; v is 1 for a point; a polygon is not closed and goes
        counterclockwise seen from above; v = 0 where a shape has no place.
    attributes
        Name to N values: text or numbers, NaN where there is none. Names carry the unit.
    above_ground_m
        N arrays (v,) of how high each vertex stands over the ground; left out where all lie on it.
    """

    name: str
    kind: ShapeKind
    vertices_m: tuple[Floats, ...]
    attributes: dict[str, Attribute]
    above_ground_m: tuple[Floats, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.vertices_m)
        for vertices in self.vertices_m:
            if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
                raise ValueError(f"layer {self.name!r}: vertices must be finite, (v, 3)")
            vertices.setflags(write=False)
        for key, values in self.attributes.items():
            if len(values) != count:
                raise ValueError(f"layer {self.name!r}: {len(values)} {key} for {count} shapes")

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.vertices_m)


def placed(shapes: tuple[Floats, ...], place: Callable[[Floats], Floats]) -> tuple[Floats, ...]:
    """Vertices (v, 3) of shapes in other coordinates: all are placed in one call."""
    counts = [len(vertices) for vertices in shapes]
    if not sum(counts):
        return shapes
    return tuple(np.split(place(np.concatenate(shapes)), np.cumsum(counts)[:-1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """A survey as layers, and where it lies.

    Attributes
    ----------
    name
        Of the project.
    layers
        In drawing order: what is drawn last lies on top.
    origin
        Latitude [deg], longitude [deg], height [m] of the local zero; None where nothing ties the
        survey to the earth.
    height_datum
        What the origin's height is above.
    crs
        Projected coordinate system for maps, such as ``EPSG:32756``; None without an origin.
    profiles
        Drawings of the measured profiles.
    """

    name: str
    layers: tuple[Layer, ...]
    origin: tuple[float, float, float] | None
    height_datum: HeightDatum
    crs: str | None
    profiles: tuple[ProfileSheet, ...] = ()

    def layer(self, name: str) -> Layer:
        """Return the layer of that name."""
        return next(layer for layer in self.layers if layer.name == name)
