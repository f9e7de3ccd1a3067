"""Surveys with ties: a few labels picked in two photos each, some lengths, and no flight log."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tied_flights import FOCAL_PX, HALF_PX, TiedFlight

from uavgram.estimation.survey.observed import Observations
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.observations import KnownLines, Picks
from uavgram.model.options import GroundOptions
from uavgram.model.survey import Survey, TiePicks
from uavgram.stages.assemble import assemble

LENS = np.array([FOCAL_PX, FOCAL_PX, HALF_PX[0], HALF_PX[1], 0.0, 0.0, 0.0, 0.0, 0.0])
LENS_SIGMA = np.array([1.0, 1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-5, 1e-5, 1e-4])
PICK_PX, LENGTH_M = 1.0, 0.01


@dataclass(frozen=True, eq=False)
class TiedSurvey:
    """What is observed; the survey of it; the true labels (K, 3) in its order, and the flight."""

    observed: Observations
    survey: Survey
    world: Floats
    flight: TiedFlight


def calibration() -> Calibration:
    """The camera of the flights, well known."""
    return Calibration(
        name="tied",
        model="brown",
        width_px=int(2 * HALF_PX[0]),
        height_px=int(2 * HALF_PX[1]),
        parameters=LENS,
        covariance=np.diag(LENS_SIGMA**2),
    )


def tied_survey(flight: TiedFlight, labels: int = 8, lengths: int = 3, seed: int = 0) -> TiedSurvey:
    """Labels on the ground (with its roughness), each in two photos; lengths between neighbours."""
    rng = np.random.default_rng((77, seed))
    image: list[str] = []
    label: list[str] = []
    pixel: list[Floats] = []
    world: list[Floats] = []
    while len(world) < labels:
        place = flight.center[rng.integers(len(flight.center))] * [1, 1, 0]
        place = place + np.append(rng.uniform(-0.5, 0.5, 2) * flight.height_m, rng.normal(0, 0.02))
        place[2] += flight.ground_m(place)
        seen = np.einsum("fj,fji->fi", place - flight.center, flight.rotation)
        at = FOCAL_PX * seen[:, :2] / seen[:, 2:]
        inside = np.flatnonzero((seen[:, 2] > 0) & (np.abs(at) < HALF_PX - 20).all(axis=1))
        if len(inside) < 2:
            continue
        for f in rng.permutation(inside)[:2]:
            image.append(f"p{f:02d}.jpg")
            label.append(f"L{len(world):02d}")
            pixel.append(at[f] + HALF_PX + rng.normal(0, PICK_PX, 2))
        world.append(place)
    places = np.array(world)
    ends = np.arange(2 * lengths).reshape(lengths, 2)
    length = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
    observed = Observations(
        calibration=calibration(),
        picks=Picks(
            image=tuple(image),
            label=tuple(label),
            pixel_px=np.array(pixel),
            sigma_px=np.full(len(image), PICK_PX),
            height_m=np.full(len(image), np.nan),
        ),
        lines=KnownLines(
            name=tuple(f"R{k}" for k in range(lengths)),
            start=tuple(f"L{a:02d}" for a in ends[:, 0]),
            end=tuple(f"L{b:02d}" for b in ends[:, 1]),
            length_m=length + rng.normal(0, LENGTH_M, lengths),
            sigma_m=np.full(lengths, LENGTH_M),
            adjust=np.ones(lengths, dtype=bool),
        ),
        ties=ties_of(flight),
        ground=replace(GroundOptions(), roughness_sigma_m=0.02),
        picks_sigma_px=PICK_PX,
        photos=tuple(f"p{f:02d}.jpg" for f in range(len(flight.center))),
    )
    survey = assemble(observed).survey
    order = [int(name[1:]) for name in survey.label]
    return TiedSurvey(observed, survey, places[order], flight)


def ties_of(flight: TiedFlight) -> TiePicks:
    """The sightings of a flight by name."""
    rays = flight.sightings
    return TiePicks(
        image=tuple(f"p{f:02d}.jpg" for f in rays.frame),
        tie=tuple(f"t{t}" for t in rays.point),
        pixel_px=FOCAL_PX * rays.ray[:, :2] / rays.ray[:, 2:] + HALF_PX,
        sigma_px=rays.sigma_rad * FOCAL_PX,
    )
