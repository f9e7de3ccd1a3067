"""What is known beforehand of distances, angles, areas and the like, as observations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays
from uavgram.model.survey.observations import MeasurementKind

ConditionKind = Literal[
    "right_angle", "collinear", "parallel", "coplanar", "level", "vertical", "equal_lengths"
]
"""What is true of points without a number; its sigma says how well."""

CONDITIONS: tuple[ConditionKind, ...] = get_args(ConditionKind)

NOT_KNOWN = {
    "coordinate": "give points with known coordinates in control.csv (`control` in the project)",
    "speed": "a speed says nothing of where the points are",
    "skid_speed": "a speed says nothing of where the points are",
    "profile": "it has no single value: give the heights or distances of its points",
}
"""Kinds of measurement that cannot be given as known, and why or what to do instead."""

KNOWN_KINDS: tuple[str, ...] = (
    *(kind for kind in get_args(MeasurementKind) if kind not in NOT_KNOWN),
    *CONDITIONS,
)
"""All kinds of known things: what can be measured, and the conditions."""

DEGREES = ("angle", "slope", "right_angle", "parallel")
"""Kinds whose sigma (and value, if there is one) is in degrees."""

UNITS = {"area": "m2", "volume": "m3"}
"""Units of kinds in other units than metres and degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownThings(FrozenArrays):
    """N things that are known of the scene, as a project states them.

    Attributes
    ----------
    name, kind
        (N,) what each is called, and what it is: one of `KNOWN_KINDS`.
    points
        (N,) labels of each, in order.
    value
        (N,) in the unit of the measurement of that kind (metres, square metres, degrees); NaN for
        conditions, which have none.
    sigma
        (N,) standard deviation in the same unit; of conditions degrees (see `DEGREES`) or metres.
    adjust
        (N,) True: an observation; False: withheld, only judged.
    parameters
        (N,) numbers that a kind needs beside its points.
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: Annotated[tuple[str, ...], "n"]
    points: Annotated[tuple[tuple[str, ...], ...], "n"]
    value: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n"]
    adjust: Annotated[Bools, "n"]
    parameters: Annotated[tuple[tuple[tuple[str, float], ...], ...], "n"]

    @property
    def gives_scale(self) -> bool:
        """Whether anything that is an observation says how large things are."""
        return any(self.thing(i, ()).gives_scale for i in np.flatnonzero(self.adjust).tolist())

    def thing(self, index: int, label: tuple[int, ...]) -> KnownThing:
        """One of them, with its points as rows of a survey's labels."""
        return KnownThing(
            index=index,
            name=self.name[index],
            kind=self.kind[index],
            label=label,
            value=float(self.value[index]),
            sigma=float(self.sigma[index]),
            parameters=self.parameters[index],
        )


@dataclass(frozen=True, kw_only=True)
class KnownThing:
    """One known thing of a survey.

    Attributes
    ----------
    index
        Which it is among the project's: it keeps that number when others are left out.
    name, kind, value, sigma, parameters
        As in `KnownThings`; the value of a condition is NaN.
    label
        Its points, as rows of the survey's labels.
    """

    index: int
    name: str
    kind: str
    label: tuple[int, ...]
    value: float
    sigma: float
    parameters: tuple[tuple[str, float], ...] = ()

    @property
    def is_condition(self) -> bool:
        """Whether it has no value."""
        return self.kind in CONDITIONS

    @property
    def gives_scale(self) -> bool:
        """Whether it says how large anything is."""
        return self.unit != "deg" and bool(np.isfinite(self.value)) and self.value != 0.0

    @property
    def unit(self) -> str:
        """Unit of its value and of its sigma."""
        return "deg" if self.kind in DEGREES else UNITS.get(self.kind, "m")


NO_KNOWN = KnownThings(
    name=(),
    kind=(),
    points=(),
    value=np.empty(0),
    sigma=np.empty(0),
    adjust=np.empty(0, dtype=np.bool_),
    parameters=(),
)
