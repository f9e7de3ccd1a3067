"""The grids of the studies that are made of single photos: what each varies, and about what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

from uavgram.model.study.scene import StudyScene
from uavgram.pipeline.study.photo_cell import Place

Where = TypeVar("Where")

Numbers = Mapping[str, float | str]
"""Of a scene, by name."""

Scenes = Mapping[str, Numbers]
"""By the words of a curve, or of a place along the axis."""


@dataclass(frozen=True, kw_only=True)
class Grid(Generic[Where]):
    """A study before it is made; fields as of `Study`, places in place of cells."""

    title: str
    question: str
    axis: str
    is_log: bool
    places: tuple[Where, ...]


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
) -> Grid[Place]:
    """A study along one axis: its title, its question and the words of its axis."""
    places = tuple(
        place for curve, others in curves.items() for place in axis.places(curve, others)
    )
    return _of(words, places, is_log=is_log)


def _of(
    words: tuple[str, str, str], places: tuple[Place, ...], *, is_log: bool = False
) -> Grid[Place]:
    title, question, axis = words
    return Grid(title=title, question=question, axis=axis, is_log=is_log, places=places)


def _each(curve: str, scenes: Scenes, others: Numbers) -> tuple[Place, ...]:
    """Places with names along the axis."""
    return tuple(
        Place(curve=curve, at=float(k), label=name, scene=_scene({**numbers, **others}))
        for k, (name, numbers) in enumerate(scenes.items())
    )


def _label(value: float, unit: str) -> str:
    if unit == "°":
        return f"{value:g}°"
    return f"{value:g} {unit[:-1] if value == 1 and unit.endswith('s') else unit}"


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
LOGS: Scenes = {"usual log": {}, "no log": {"log": "none"}, "RTK": {"log": "rtk"}}
MARKS: Numbers = {"layout": "plates", "tape_m": 0.0005, "mark_px": 0.1}
"""Plates, printed to half a millimetre, whose corners the program itself finds to a tenth pixel."""

CAMERAS: Scenes = {
    "looking 20° to the side": {},
    "20°, principal point to 30 px": {"centre_px": 30.0},
    "20°, principal point to 100 px": {"centre_px": 100.0},
    "looking 50° to the side": {"tilt_deg": 50.0},
    "20°, one length and the log": {"lines": 1},
}
LAYOUTS: Scenes = {
    "10 m, around the scene": {},
    "14 m, around the scene": {"line_m": 14.0},
    "3 m, around the scene": {"line_m": 3.0},
    "10 m, all on one side": {"layout": "side"},
    "3 m, all in a corner": {"layout": "corner", "line_m": 3.0},
}
GROUNDS: Scenes = {
    "looking 20° to the side": {},
    "looking straight down": {"tilt_deg": 0.0},
    "looking 50° to the side": {"tilt_deg": 50.0},
    "20°, read in 30 ms at 18 km/h": {"readout_ms": 30.0},
    "20°, read in 30 ms at 43 km/h": {"readout_ms": 30.0, "speed_m_s": 12.0},
}
LENSES: Scenes = {
    "looking 20° to the side": {},
    "looking straight down": {"tilt_deg": 0.0},
    "straight down, from 80 m": {"tilt_deg": 0.0, "height_m": 80.0},
}
PLATE_LOGS: Scenes = {"usual log": {}, "no log": {"log": "none"}}

PLATES: Scenes = {
    "4 tapes\n10 m": {"lines": 4},
    "6 tapes\n10 m": {},
    "4 plates\n0.3 m": {**MARKS, "lines": 4, "line_m": 0.3},
    "4 plates\n0.5 m": {**MARKS, "lines": 4, "line_m": 0.5},
    "4 plates\n1 m": {**MARKS, "lines": 4, "line_m": 1.0},
    "6 plates\n0.5 m": {**MARKS, "lines": 6, "line_m": 0.5},
}
COUNT = partial(_Axis, key="lines", unit="lengths")

GRIDS: dict[str, Grid[Place]] = {
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
    "lines": _grid(
        (
            "Number and placement of the lengths",
            "How many lengths are enough, and where should they lie?",
            "taped lengths",
        ),
        COUNT(values=(3, 4, 5, 6, 8, 12)),
        LAYOUTS,
    ),
    "telemetry": _of(
        (
            "What the flight log adds",
            "What is a better receiver worth beside the taped lengths?",
            "taped lengths",
        ),
        tuple(
            place
            for name, log in LOGS.items()
            for place in COUNT(values=((1, 2) if name != "no log" else ()) + (3, 4, 6, 8)).places(
                name, log
            )
        ),
    ),
    "ground": _grid(
        (
            "Relief and shutter that nobody states",
            "What do uneven ground and a slow shutter do to a prediction that knows neither?",
            "relief of the ground [cm], alike over 5 m",
        ),
        _Axis(key="relief_m", values=(0.0, 0.01, 0.02, 0.05, 0.1), unit="cm", factor=100.0),
        GROUNDS,
    ),
    "distortion": _grid(
        (
            "Distortion left out of the camera file",
            "How much distortion may be ignored?",
            "ignored radial distortion k1",
        ),
        _Axis(key="bulge", values=(-0.1, -0.05, -0.02, -0.01, -0.005, 0.0), unit="in k1"),
        LENSES,
    ),
    "plates": _of(
        (
            "Plates against tapes",
            "Can small plates with known sides replace taped lengths?",
            "what is known",
        ),
        tuple(place for name, log in PLATE_LOGS.items() for place in _each(name, PLATES, log)),
    ),
    "blunder": _grid(
        (
            "One length misread",
            "How large a misreading stays unseen, and what does it do?",
            "misreading of one length [m]",
        ),
        _Axis(key="blunder_m", values=(0.0, 0.05, 0.1, 0.2, 0.5, 1.0), unit="m"),
        {f"{count} lengths": {"lines": count} for count in (3, 4, 6, 8)},
    ),
}
"""By name, in the order of pages."""
