"""Lines of known position, from the project's coordinates to known things of the local world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.survey.control_lines import ON_LINE, ControlLines, LinePosition
from uavgram.model.survey.known import KnownThings
from uavgram.model.survey.observations import KnownPoints
from uavgram.model.survey.world import World
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import known_in_world


def with_position_lines(inputs: Inputs, world: World) -> tuple[Inputs, tuple[Message, ...]]:
    """Inputs whose known things are joined by the lines of known position, behind the others.

    Where nothing ties the world to the earth, lines with latitude and longitude stay out, with a
    message.
    """
    lines = inputs.control_lines
    if not lines.name:
        return inputs, ()
    ends, messages = known_in_world(inputs, _ends(lines, world), world)
    if not ends.label:
        return inputs, messages
    has_height = np.isfinite(lines.coordinates[:, 0, 2])
    placed = [
        LinePosition(
            ends_m=_without_height(place, has_height=high),
            sigma_m=np.nan_to_num(sigma),
            straightness_m=float(own),
            has_height=bool(high),
        )
        for place, sigma, own, high in zip(
            ends.world_m.reshape(-1, 2, 3),
            lines.sigma_m,
            lines.straightness_m,
            has_height,
            strict=True,
        )
    ]
    known, none = inputs.known, (None,) * len(inputs.known.name)
    count = len(lines.name)
    joined = KnownThings(
        name=(*known.name, *lines.name),
        kind=(*known.kind, *(ON_LINE,) * count),
        points=(*known.points, *lines.points),
        value=np.concatenate([known.value, np.full(count, np.nan)]),
        sigma=np.concatenate([known.sigma, [line.across_m for line in placed]]),
        adjust=np.concatenate([known.adjust, lines.adjust]),
        parameters=(*known.parameters, *((),) * count),
        position=(*none, *placed),
    )
    return replace(inputs, known=joined), ()


def _ends(lines: ControlLines, world: World) -> KnownPoints:
    """Starts and ends in turn; unknown heights as that of the origin, which moves nothing in plan.

    East and north of a place 100 m higher grow by 1.6e-5 of themselves.
    """
    coordinates = lines.coordinates.reshape(-1, 3).copy()
    origin = 0.0 if lines.kind == "local" or world.origin is None else world.origin[2]
    coordinates[np.isnan(coordinates[:, 2]), 2] = origin
    return KnownPoints(
        label=tuple(name for name in lines.name for _ in range(2)),
        kind=lines.kind,
        coordinates=coordinates,
        sigma_m=np.nan_to_num(lines.sigma_m.reshape(-1, 3)),
    )


def _without_height(place: Floats, *, has_height: bool) -> Floats:
    return place if has_height else place * [1.0, 1.0, 0.0]
