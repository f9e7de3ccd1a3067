"""Random scenes to plan for: an area, distances to measure in it, a flight that shows all of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.errors import GeometryError
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import GroundOptions
from uavgram.model.planned import FlightPattern, PlanRequest
from uavgram.synthetic.plan.flights import PlannedCameras, find_visible, make_flight
from uavgram.synthetic.plan.scene import (
    Deviation,
    LoggedAccuracy,
    PlanScene,
    WantedValues,
    list_wanted,
)

DISTANCES = 20
SIGMA = np.array([12.0, 12.0, 8.0, 8.0, 6e-3, 6e-3, 4e-4, 4e-4, 2e-3])
STEADY = Deviation(position_m=0.0, attitude_deg=0.0)


def camera(focal_px: float = 2250.0) -> Calibration:
    """A calibrated camera of seven megapixels."""
    return Calibration(
        name="camera",
        model="brown",
        width_px=3000,
        height_px=2250,
        parameters=np.array([focal_px, focal_px, 1500.0, 1125.0, 0, 0, 0, 0, 0]),
        covariance=np.diag(SIGMA**2),
    )


@dataclass(frozen=True)
class PlanCase:
    """A scene, its flight, and how many lines are to be laid out."""

    scene: PlanScene
    cameras: PlannedCameras
    wanted: WantedValues
    lines: int
    longest_m: float


def plan_case(
    pattern: FlightPattern,
    seed: int,
    *,
    roughness_m: float = 0.0,
    lines: int | None = None,
    deviation: Deviation = STEADY,
) -> PlanCase:
    """A random scene that a flight of the pattern shows completely, even if it deviates.

    20 to 60 m long, flown as low as shows it all, tilted by up to 30 degrees; half of the scenes
    without a log.
    """
    rng = np.random.default_rng([seed, len(pattern)])
    while True:
        case = _drawn(pattern, rng, (roughness_m, deviation), lines)
        if case is not None:
            return case


def _drawn(
    pattern: FlightPattern,
    rng: np.random.Generator,
    known: tuple[float, Deviation],
    lines: int | None,
) -> PlanCase | None:
    roughness_m, deviation = known
    half = 0.5 * np.array([rng.uniform(20, 60), rng.uniform(15, 40)])
    area = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    point = rng.uniform(-0.95, 0.95, (2 * DISTANCES, 2)) * half
    label = tuple(f"p{i}" for i in range(len(point)))
    scene = PlanScene(
        calibration=camera(rng.uniform(2000, 2600)),
        slope=rng.normal(0.0, 0.02, 2),
        area_m=area,
        label=label,
        point_m=point,
        requests=tuple(
            MeasurementRequest(name=f"d{i}", kind="distance", points=label[2 * i : 2 * i + 2])
            for i in range(DISTANCES)
        ),
        ground=GroundOptions(roughness_sigma_m=roughness_m),
        logged=LoggedAccuracy() if rng.random() < 0.5 else None,
        picks_sigma_px=rng.uniform(0.5, 1.0),
        deviation=deviation,
    )
    request = PlanRequest(area=())
    pitch, photos = (
        -90.0 + rng.uniform(0, 30),
        1 if pattern == "single" else int(rng.integers(4, 9)),
    )
    count = int(rng.integers(3, 7)) if lines is None else lines
    for height in np.arange(15.0, 120.0, 2.5):
        flown = make_flight(scene, request, (pattern, float(height), float(pitch)), photos)
        must = scene.on_ground(np.concatenate([area, point]))
        if flown and _shows(scene, flown.cameras, must):
            longest = min(15.0, 0.9 * float(2 * half.min()))
            return PlanCase(scene, flown.cameras, list_wanted(scene), count, longest)
    return None


def _shows(scene: PlanScene, cameras: PlannedCameras, point_m: Floats) -> bool:
    try:
        shown = find_visible(scene.calibration, cameras, point_m, scene.deviation).certain
    except GeometryError:
        return False
    return bool(shown.any(axis=0).all())
