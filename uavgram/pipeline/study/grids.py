"""The grids of the studies that are made of single photos: what each varies, and about what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from uavgram.model.study.scene import StudyScene
from uavgram.pipeline.study.photo_cell import Place

Numbers = Mapping[str, float | str]
"""Of a scene, by name."""

Scenes = Mapping[str, Numbers]
"""By the words of a curve."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A study before it is made; fields as of `Study`, places in place of cells."""

    title: str
    question: str
    axis: str
    is_log: bool
    places: tuple[Place, ...]


@dataclass(frozen=True, kw_only=True)
class _Axis:
    """What varies along the curves of a study: a number of the scene, and how it is told."""

    key: str
    values: tuple[float, ...]
    unit: str
    factor: float = 1.0

    def places(self, curve: str, others: Numbers) -> tuple[Place, ...]:
        """Places along one curve; others hold along it."""
        return tuple(
            Place(
                curve=curve,
                at=self.factor * value,
                label=_label(self.factor * value, self.unit),
                scene=_scene({self.key: value, **others}),
            )
            for value in self.values
        )


def _grid(
    words: tuple[str, str, str], axis: _Axis, curves: Scenes, *, is_log: bool = False
) -> Grid:
    """A study along one axis: its title, its question and the words of its axis."""
    title, question, name = words
    places = tuple(
        place for curve, others in curves.items() for place in axis.places(curve, others)
    )
    return Grid(title=title, question=question, axis=name, is_log=is_log, places=places)


def _label(value: float, unit: str) -> str:
    return f"{value:g}°" if unit == "°" else f"{value:g} {unit}"


def _scene(numbers: dict[str, Any]) -> StudyScene:
    return StudyScene(**numbers)


def _heights(*heights_m: float) -> Scenes:
    return {f"from {height:g} m": {"height_m": height} for height in heights_m}


MM, PERCENT = 1e3, 1e2
TAPES: Scenes = {
    "picks to 0.8 px": {},
    "picks to 0.3 px": {"pick_px": 0.3},
    "picks to 1.5 px": {"pick_px": 1.5},
    "picks to 3 px": {"pick_px": 3.0},
    "0.8 px, and a tape scale of 0.1 %": {"tape_scale": 1e-3},
}
CAMERAS: Scenes = {
    "looking 20° to the side": {},
    "20°, principal point to 30 px": {"centre_px": 30.0},
    "20°, principal point to 100 px": {"centre_px": 100.0},
    "looking 50° to the side": {"tilt_deg": 50.0},
    "20°, one length and the log": {"lines": 1},
}

GRIDS: dict[str, Grid] = {
    "lengths": _grid(
        (
            "Errors in the reference lengths",
            "When does the error of the taped lengths matter more than that of the picks?",
            "standard deviation of a taped length [mm]",
        ),
        _Axis(
            key="tape_m", values=(0.001, 0.003, 0.01, 0.02, 0.03, 0.05, 0.1), unit="mm", factor=MM
        ),
        TAPES,
        is_log=True,
    ),
    "picks": _grid(
        (
            "Errors of picking",
            "What does it cost to click less carefully?",
            "standard deviation of a pick [px]",
        ),
        _Axis(key="pick_px", values=(0.1, 0.3, 0.8, 1.5, 3.0), unit="px"),
        _heights(30.0, 60.0, 100.0),
        is_log=True,
    ),
    "view": _grid(
        (
            "Camera height and look direction",
            "How high may the camera be, and how far may it look to the side?",
            "tilt of the view from straight down [degrees]",
        ),
        _Axis(key="tilt_deg", values=(0.0, 10.0, 20.0, 30.0, 45.0, 60.0), unit="°"),
        _heights(32.0, 50.0, 80.0, 120.0),
    ),
    "camera": _grid(
        (
            "Focal length and principal point",
            "How well must the camera be calibrated?",
            "standard deviation of the focal length [%]",
        ),
        _Axis(key="focal_share", values=(0.0, 0.002, 0.01, 0.02, 0.05), unit="%", factor=PERCENT),
        CAMERAS,
    ),
}
"""By name, in the order of pages."""
