"""Flights over a scene with four coded plates and nothing else that is known.

Corners are seen with the error that the fit of their pictures has (see tests of
imaging/targets/plates); all plates are printed by one printer, whose scale is off by what the
project says it may be. Withheld points are picked by hand, with the noise that is stated.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from uavgram.model.arrays import Floats
from uavgram.model.naming import corner_label, plate_of
from uavgram.model.observations import MeasurementRequest
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.errors import ErrorSpec
from uavgram.synthetic.scenario import FlightPlan, Scenario
from uavgram.synthetic.survey import simulate
from uavgram.synthetic.truth import project_rolling_shutter

PLATES, WITHHELD = 4, 6
SIDE_M, SIGMA_M = 0.3, 0.0005
CORNER_PX, HAND_PX = 0.035, 0.5
_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_ROAD_M = np.array([[-12.0, -3.5], [12.0, 3.5]])


@dataclass(frozen=True)
class PlateFlight:
    """A project on disk, and the true distances between its withheld points by their names."""

    project: Path
    truth: dict[str, float]


def plate_flight(
    folder: Path, seed: int, *, log: bool = True, corner_px: float = CORNER_PX
) -> PlateFlight:
    """Write a flight of eight photos.

    Parameters
    ----------
    folder
        Where.
    seed
        Of everything that is drawn.
    log
        Whether there is a flight log.
    corner_px
        True noise of the plates' corners; their stated one is `CORNER_PX`.
    """
    rng = np.random.default_rng([seed, 16])
    scale = 1.0 + SIGMA_M / SIDE_M * rng.standard_normal()
    survey = simulate(_scenario(seed, scale * SIDE_M, rng))
    blank = np.full((survey.calibration.height_px, survey.calibration.width_px), 128, np.uint8)
    write_demo(folder, survey, (blank for _ in survey.frame_id))
    truth = survey.truth
    true = project_rolling_shutter(survey.calibration, truth, truth.point_world_m[None])
    frame = {name: i for i, name in enumerate(truth.frame_id)}
    point = {name: i for i, name in enumerate(truth.label)}
    rows = []
    for image, label in zip(survey.picks.image, survey.picks.label, strict=True):
        is_plate = plate_of(label) is not None
        noise = corner_px if is_plate else HAND_PX
        u, v = (true[frame[image], point[label]] + noise * rng.standard_normal(2)).tolist()
        stated = CORNER_PX if is_plate else HAND_PX
        rows.append((image, label, f"{u:.4f}", f"{v:.4f}", stated, "target" if is_plate else ""))
    with (folder / "picks.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(("image", "label", "u_px", "v_px", "sigma_px", "source"))
        table.writerows(rows)
    _write_project(folder, survey.scenario.errors, log=log)
    values = zip(truth.measurement_name, truth.measurement_value.tolist(), strict=True)
    return PlateFlight(folder / "project.yaml", dict(values))


def _scenario(seed: int, side_m: float, rng: np.random.Generator) -> Scenario:
    centers = _apart(rng, PLATES + WITHHELD, 2.0)
    points = []
    for plate, center in enumerate(centers[:PLATES]):
        turn = rng.uniform(0.0, 2 * np.pi)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        for corner, (x, y) in enumerate((center + side_m * _SQUARE @ rotation.T).tolist()):
            points.append(ScenePoint(label=corner_label(plate, corner), x_m=x, y_m=y))
    withheld = [f"P{i}" for i in range(WITHHELD)]
    for label, (x, y) in zip(withheld, centers[PLATES:].tolist(), strict=True):
        points.append(ScenePoint(label=label, x_m=x, y_m=y))
    pairs = [(a, b) for i, a in enumerate(withheld) for b in withheld[:i]]
    requests = tuple(
        MeasurementRequest(name=f"{a} {b}", kind="distance", points=(a, b)) for a, b in pairs
    )
    return replace(
        Scenario(),
        seed=seed,
        flight=FlightPlan(photos_per_strip=4, strip_half_length_m=12.0),
        errors=ErrorSpec(lost_exposure=3),
        points=tuple(points),
        lines=(SceneLine(name="unused", start="P0", end="P1"),),
        measurements=requests,
    )


def _apart(rng: np.random.Generator, count: int, least_m: float) -> Floats:
    """Places on the road, none too near to another."""
    places: list[Floats] = []
    while len(places) < count:
        one = rng.uniform(*_ROAD_M)
        if all(np.linalg.norm(one - other) > least_m for other in places):
            places.append(one)
    return np.array(places)


def _write_project(folder: Path, errors: ErrorSpec, *, log: bool) -> None:
    project: dict[str, object] = {
        "images": "photos/*.jpg",
        "camera": "camera.yaml",
        "picks": "picks.csv",
        "measure": "measure.csv",
        "targets": {"family": "aruco-4x4-50", "side_m": SIDE_M, "sigma_m": SIGMA_M},
    }
    if log:
        project |= {
            "log": "flight.tlog",
            "mount": {"lever_arm_m": list(errors.lever_arm_m), "lever_arm_sigma_m": 0.05},
            "time": {"offset_s": errors.camera_clock_offset_s, "offset_sigma_s": 0.1},
        }
    (folder / "project.yaml").write_text(yaml.safe_dump(project), encoding="utf-8")
