"""Built-in scene of an accident at a side road, and recognition of the sample project.

Scene axes: x along the main road, y to its left, metres, origin at the middle of the scene. `Site`
(scenario.py) gives the position of that origin in the world and the direction of the road.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from uavgram.model.limits import require

Mark = Literal["checker", "cross", "disc"]


@dataclass(frozen=True, kw_only=True)
class ScenePoint:
    """A labelled point with the mark that shows it.

    Attributes
    ----------
    label
        Its name, painted beside the mark.
    x_m, y_m
        Scene axes.
    mark
        ``checker``: a plate of four fields; ``cross``: sprayed paint; ``disc``: a round target,
        whose coordinates are known to the survey and withheld as a check.
    height_m
        Above the ground directly below.
    stated
        Declaration of a height that is not 0: its value (``height``), that it is an unknown
        (``free``), or none (``ground``).
    label_side
        Side of the mark on which the label is painted, for a viewer looking along x.
    """

    label: str
    x_m: float
    y_m: float
    mark: Mark = "cross"
    height_m: float = 0.0
    stated: Literal["height", "free", "ground"] = "height"
    label_side: Literal["left", "right"] = "right"


@dataclass(frozen=True, kw_only=True)
class SceneLine:
    """A length to be taped between two labels; ``check`` ones are withheld."""

    name: str
    start: str
    end: str
    use: Literal["adjust", "check"] = "adjust"

    def __post_init__(self) -> None:
        require(self.start != self.end, f"{self.name!r} must go from one point to another")


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A car, drawn flat on the ground.

    Attributes
    ----------
    x_m, y_m, heading_deg
        Its middle, and its heading from the scene's x axis, counterclockwise.
    length_m, width_m
        Of its body.
    color_rgb
        0 to 255.
    """

    x_m: float
    y_m: float
    heading_deg: float
    length_m: float
    width_m: float
    color_rgb: tuple[int, int, int]


@dataclass(frozen=True, kw_only=True)
class RoadLayout:
    """Main road along x, with a side road that joins it from the right (-y).

    Attributes
    ----------
    width_m
        Of the main road's asphalt.
    side_x_m, side_width_m
        Axis and width of the side road.
    corner_radius_m
        Of the kerbs between the two.
    skid_marks
        Polylines of (x, y).
    vehicles
        Vehicles in their final positions.
    debris
        Four corners (x, y) of the field of glass and plastic; empty: there is none.
    """

    width_m: float = 7.0
    side_x_m: float = 6.0
    side_width_m: float = 6.0
    corner_radius_m: float = 4.0
    skid_marks: tuple[tuple[tuple[float, float], ...], ...] = (
        ((-15.5, -1.0), (-10.0, -0.95), (-5.3, -0.72), (-1.5, -0.32), (1.4, 0.12), (2.6, 0.36)),
        ((-15.1, -2.5), (-9.8, -2.45), (-5.0, -2.22), (-1.2, -1.8), (1.75, -1.35), (2.9, -1.12)),
    )
    vehicles: tuple[Vehicle, ...] = (
        Vehicle(
            x_m=4.0, y_m=-0.1, heading_deg=12.0, length_m=4.5, width_m=1.82, color_rgb=(38, 74, 128)
        ),
        Vehicle(
            x_m=7.6, y_m=1.3, heading_deg=70.0, length_m=4.2, width_m=1.75, color_rgb=(172, 34, 30)
        ),
    )
    debris: tuple[tuple[float, float], ...] = ((8.6, -3.0), (13.6, -2.3), (15.2, 2.1), (10.6, 3.0))

    def __post_init__(self) -> None:
        for name in ("width_m", "side_width_m", "corner_radius_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        require(len(self.debris) in {0, 4}, "debris must name four corners, or none")
        short = any(len(mark) < 2 for mark in self.skid_marks)
        require(not short, "skid_marks: each needs two points or more")


def _list_points(
    mark: Mark, side: Literal["left", "right"], *rows: tuple[str, float, float]
) -> tuple[ScenePoint, ...]:
    return tuple(
        ScenePoint(label=label, x_m=x, y_m=y, mark=mark, label_side=side) for label, x, y in rows
    )


DEMO_POINTS: tuple[ScenePoint, ...] = (
    *_list_points(
        "checker",
        "left",
        ("R1", -20.0, 5.4),
        ("R2", -8.0, 5.3),
        ("R3", 6.0, 5.3),
        ("R4", 19.0, 5.4),
    ),
    *_list_points(
        "checker",
        "right",
        ("R5", -19.0, -5.2),
        ("R6", -6.0, -5.6),
        ("R7", 15.5, -6.0),
        ("R8", 21.5, -4.9),
    ),
    *_list_points(
        "cross",
        "left",
        ("P1", -15.5, -1.0),  # left skid mark: start, middle, end
        ("P15", -5.3, -0.72),
        ("P2", 1.4, 0.12),
        ("P5", 5.0, 1.5),  # wheels of the cars
        ("P11", 15.2, 2.1),  # debris field
        ("P12", 10.6, 3.0),
        ("P13", 6.2, -8.2),  # stop line of the side road
        ("P16", -11.0, 3.2),  # edge line
    ),
    *_list_points(
        "cross",
        "right",
        ("P3", -15.1, -2.5),  # right skid mark
        ("P4", 1.75, -1.35),
        ("P6", 8.3, -0.3),
        ("P7", 9.3, 2.0),
        ("P8", 6.0, -1.6),  # gouge in the asphalt: the impact
        ("P9", 8.6, -3.0),
        ("P10", 13.6, -2.3),
        ("P14", 8.3, -8.2),
    ),
    *_list_points(
        "disc",
        "right",
        ("C1", -16.0, 9.0),
        ("C2", 14.5, 9.2),
        ("C3", -12.0, -9.0),
        ("C4", 17.5, -9.3),
    ),
)

DEMO_LINES: tuple[SceneLine, ...] = (
    SceneLine(name="L1", start="R1", end="R2"),
    SceneLine(name="L2", start="R3", end="R4"),
    SceneLine(name="L3", start="R5", end="R6"),
    SceneLine(name="L4", start="R7", end="R8"),
    SceneLine(name="L5", start="R2", end="R6"),
    SceneLine(name="L6", start="R3", end="R7", use="check"),
)


SAMPLE_MARK = "# The sample survey of `uavgram pick --sample`:"
"""First line of the sample's project file; the user may change all that follows."""

TAPE_FILE = "taped.txt"
"""File with the readings of the tape, next to the project file."""

PAINTED_LABELS = tuple(point.label for point in DEMO_POINTS)
"""Labels that are painted on the ground of the sample."""


def is_sample(project: Path) -> bool:
    """Return whether a project file is that of a sample."""
    try:
        with project.open(encoding="utf-8") as stream:
            return stream.readline().startswith(SAMPLE_MARK)
    except (OSError, UnicodeDecodeError):
        return False
