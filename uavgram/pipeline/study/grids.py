"""The grids of the studies that are made of single photos: what each varies, and about what."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from uavgram.model.study.scene import StudyScene
from uavgram.pipeline.study.photo_cell import Place

Numbers = Mapping[str, float | str]
"""Of a scene, by name."""

Scenes = Mapping[str, Numbers]
"""By the words of a curve, or of a place along the axis."""

USUAL: Numbers = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A study before it is made; fields as of `Study`."""

    title: str
    question: str
    axis: str
    is_log: bool
    places: tuple[Place, ...]


def _curve(
    curve: str,
    key: str,
    values: Iterable[float],
    unit: str,
    factor: float = 1.0,
    others: Numbers = USUAL,
) -> tuple[Place, ...]:
    """Places along one number of the scene; others hold along the curve."""
    return tuple(
        Place(
            curve=curve,
            at=factor * value,
            label=_label(factor * value, unit),
            scene=_scene({key: value, **others}),
        )
        for value in values
    )


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


MM, PERCENT = 1e3, 1e2
TAPES = (0.001, 0.003, 0.01, 0.02, 0.03, 0.05, 0.1)
LOGS: Scenes = {
    "usual log": {"log": "consumer"},
    "no log": {"log": "none"},
    "RTK": {"log": "rtk"},
}
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

GRIDS: dict[str, Grid] = {
    "lengths": Grid(
        title="Errors in the reference lengths",
        question="When does the error of the taped lengths matter more than that of the picks?",
        axis="standard deviation of a taped length [mm]",
        is_log=True,
        places=(
            *_curve("picks to 0.8 px", "tape_m", TAPES, "mm", MM),
            *_curve("picks to 0.3 px", "tape_m", TAPES, "mm", MM, {"pick_px": 0.3}),
            *_curve("picks to 1.5 px", "tape_m", TAPES, "mm", MM, {"pick_px": 1.5}),
            *_curve("picks to 3 px", "tape_m", TAPES, "mm", MM, {"pick_px": 3.0}),
            *_curve(
                "0.8 px, and a tape scale of 0.1 %", "tape_m", TAPES, "mm", MM, {"tape_scale": 1e-3}
            ),
        ),
    ),
    "picks": Grid(
        title="Errors of picking",
        question="What does it cost to click less carefully?",
        axis="standard deviation of a pick [px]",
        is_log=True,
        places=tuple(
            place
            for height in (30.0, 60.0, 100.0)
            for place in _curve(
                f"from {height:g} m",
                "pick_px",
                (0.1, 0.3, 0.8, 1.5, 3.0),
                "px",
                others={"height_m": height},
            )
        ),
    ),
    "view": Grid(
        title="Camera height and look direction",
        question="How high may the camera be, and how far may it look to the side?",
        axis="tilt of the view from straight down [degrees]",
        is_log=False,
        places=tuple(
            place
            for height in (32.0, 50.0, 80.0, 120.0)
            for place in _curve(
                f"from {height:g} m",
                "tilt_deg",
                (0.0, 10.0, 20.0, 30.0, 45.0, 60.0),
                "°",
                others={"height_m": height},
            )
        ),
    ),
    "camera": Grid(
        title="Focal length and principal point",
        question="How well must the camera be calibrated?",
        axis="standard deviation of the focal length [%]",
        is_log=False,
        places=tuple(
            place
            for name, others in CAMERAS.items()
            for place in _curve(
                name, "focal_share", (0.0, 0.002, 0.01, 0.02, 0.05), "%", PERCENT, others
            )
        ),
    ),
    "lines": Grid(
        title="Number and placement of the lengths",
        question="How many lengths are enough, and where should they lie?",
        axis="taped lengths",
        is_log=False,
        places=tuple(
            place
            for name, others in LAYOUTS.items()
            for place in _curve(name, "lines", (3, 4, 5, 6, 8, 12), "lengths", 1.0, others)
        ),
    ),
    "telemetry": Grid(
        title="What the flight log adds",
        question="What is a better receiver worth beside the taped lengths?",
        axis="taped lengths",
        is_log=False,
        places=tuple(
            place
            for name, log in LOGS.items()
            for place in _curve(
                name,
                "lines",
                (3, 4, 6, 8) if name == "no log" else (1, 2, 3, 4, 6, 8),
                "lengths",
                others=log,
            )
        ),
    ),
    "ground": Grid(
        title="Relief and shutter that nobody states",
        question="What do uneven ground and a slow shutter do to a prediction that knows neither?",
        axis="relief of the ground [cm], alike over 5 m",
        is_log=False,
        places=tuple(
            place
            for name, others in GROUNDS.items()
            for place in _curve(name, "relief_m", (0.0, 0.01, 0.02, 0.05, 0.1), "cm", 100.0, others)
        ),
    ),
    "distortion": Grid(
        title="Distortion left out of the camera file",
        question="How much distortion may be ignored?",
        axis="ignored radial distortion k1",
        is_log=False,
        places=tuple(
            place
            for name, others in LENSES.items()
            for place in _curve(
                name, "bulge", (-0.1, -0.05, -0.02, -0.01, -0.005, 0.0), "in k1", 1.0, others
            )
        ),
    ),
    "plates": Grid(
        title="Plates against tapes",
        question="Can small plates with known sides replace taped lengths?",
        axis="what is known",
        is_log=False,
        places=tuple(
            place
            for name, others in PLATE_LOGS.items()
            for place in _each(
                name,
                {
                    "4 tapes\n10 m": {"lines": 4},
                    "6 tapes\n10 m": {},
                    "4 plates\n0.3 m": {**MARKS, "lines": 4, "line_m": 0.3},
                    "4 plates\n0.5 m": {**MARKS, "lines": 4, "line_m": 0.5},
                    "4 plates\n1 m": {**MARKS, "lines": 4, "line_m": 1.0},
                    "6 plates\n0.5 m": {**MARKS, "lines": 6, "line_m": 0.5},
                },
                others,
            )
        ),
    ),
    "blunder": Grid(
        title="One length misread",
        question="How large a misreading stays unseen, and what does it do?",
        axis="misreading of one length [m]",
        is_log=False,
        places=tuple(
            place
            for count in (3, 4, 6, 8)
            for place in _curve(
                f"{count} lengths",
                "blunder_m",
                (0.0, 0.05, 0.1, 0.2, 0.5, 1.0),
                "m",
                others={"lines": count},
            )
        ),
    ),
}
"""By name, in the order of pages."""
