"""Cells of the study of several photos: scenarios, repeated by the program itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.model.scenario.errors import ErrorSpec, StatedSpec
from uavgram.model.scenario.flight import FlightPlan, Station
from uavgram.model.scenario.ground import GroundSpec
from uavgram.model.scenario.road import SceneLine, ScenePoint
from uavgram.model.scenario.scenario import CameraSpec, Scenario, Site
from uavgram.model.study.scene import StudyScene
from uavgram.model.study.study import Cell
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.pipeline.simulate.repeat import gathered, one_repetition, predicted
from uavgram.pipeline.simulate.worlds import ScenarioWorld
from uavgram.pipeline.study.grids import Grid
from uavgram.pipeline.study.method_scenes import SIZE_PX
from uavgram.pipeline.study.photo_cell import ratio_of
from uavgram.pipeline.study.photo_scene import LENS, photo_of


@dataclass(frozen=True, kw_only=True)
class SurveyPlace:
    """Where a cell stands: curve, value on the axis and its words, photos, their base, relief."""

    curve: str
    at: float
    label: str
    photos: int
    base_m: float
    relief_m: float = 0.0
    readout_ms: float = 0.0


def photos_text(count: int) -> str:
    """So many photos."""
    return "1 photo" if count == 1 else f"{count} photos"


def _places() -> tuple[SurveyPlace, ...]:
    counts = (1, 2, 4, 6)
    found = [
        SurveyPlace(curve=f"over {base:g} m", at=n, label=photos_text(n), photos=n, base_m=base)
        for base in (6.0, 24.0)
        for n in counts
    ]
    found += [
        SurveyPlace(
            curve="over 24 m, relief of 5 cm",
            at=n,
            label=photos_text(n),
            photos=n,
            base_m=24.0,
            relief_m=0.05,
        )
        for n in counts
    ]
    return tuple(found)


PHOTOS = Grid(
    title="Number of photos and their base",
    question="What do more photos bring, and how far apart should they be taken?",
    axis="photos",
    is_log=False,
    places=_places(),
)


def survey_of(place: SurveyPlace) -> Scenario:
    """The scenario of a cell: everything that the project states is drawn from what it states.

    Parameters
    ----------
    place
        Which cell.
    """
    photo = photo_of(StudyScene(tilt_deg=0.0))
    label = [f"P{i + 1}" for i in range(len(photo.place_m))]
    points = tuple(
        ScenePoint(label=name, x_m=x, y_m=y)
        for name, (x, y) in zip(label, photo.place_m.tolist(), strict=True)
    )
    lines = tuple(
        SceneLine(name=f"L{i + 1}", start=label[a], end=label[b])
        for i, (a, b) in enumerate(photo.design.line.tolist())
    )
    wanted = tuple(
        MeasurementRequest(name=f"D{i + 1}", kind="distance", points=(label[a], label[b]))
        for i, (a, b) in enumerate(photo.pairs.tolist())
    )
    across = np.linspace(-0.5, 0.5, place.photos) if place.photos > 1 else np.zeros(1)
    stations = tuple(
        Station(x_m=float(place.base_m * one), y_m=0.0, height_m=40.0) for one in across
    )
    return Scenario(
        name="study of photos",
        site=replace(Site(), ground_height_m=0.0, ground_slope_deg=(0.0, 0.0)),
        ground=GroundSpec(relief_m=place.relief_m),
        camera=CameraSpec(
            name="study",
            width_px=SIZE_PX[0],
            height_px=SIZE_PX[1],
            parameters=tuple(LENS.tolist()),
            sigma=(4.0, 4.0, 2.5, 2.5, 0.002, 0.004, 1e-4, 1e-4, 0.001),
        ),
        flight=FlightPlan(pattern="poses", poses=stations),
        telemetry="none",
        errors=ErrorSpec(pick_px=0.8, readout_ms=place.readout_ms),
        stated=StatedSpec(tape_scale_sigma=0.0, noise="stated"),
        points=points,
        lines=lines,
        measurements=wanted,
    )


def survey_cell(place: SurveyPlace, repetitions: int) -> Cell:
    """Predict and simulate, all by the stages of a real run.

    Parameters
    ----------
    place
        Which cell.
    repetitions
        How many surveys are drawn.
    """
    world = ScenarioWorld(survey_of(place))
    name, unit, sigma = predicted(world)
    found = gathered([one_repetition(world, i) for i in range(repetitions)], name, unit, sigma)
    error = np.where(found.counted, found.value - found.true, np.nan)
    good = np.isfinite(error).all(axis=1)
    error = error[good]
    low, middle, high = ratio_of(error / sigma)
    red = np.array([level == "red" for level in found.level])[good]
    return Cell(
        curve=place.curve,
        at=float(place.at),
        label=place.label,
        predicted_m=float(np.sqrt(np.mean(sigma**2))),
        simulated_m=float(np.sqrt(np.mean(error**2))),
        ratio=middle,
        ratio_range=(low, high),
        bias_m=float(np.sqrt(np.mean(error.mean(axis=0) ** 2))),
        shares=(),
        told=float(red.mean()),
        repetitions=repetitions,
        lost=int((~good).sum()),
        is_model=not (place.relief_m or place.readout_ms),
    )
