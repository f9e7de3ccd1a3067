"""One photo of a lane and two more points, without a log: what is known of it, and the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scenes
from scenes import cv_pixels, look_down, make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground import measurements
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey

MEASURED = (4, 5)
"""The points whose distance is judged: on no line of the lane."""

SIGMA_DEG, SIGMA_M = 0.3, 0.01
"""Of angles and parallels, and of lengths, widths and their equality."""


@dataclass(frozen=True)
class Lane:
    """A survey of one photo, and the truth.

    Attributes
    ----------
    survey
        Labels P0 to P3: corners of the lane in order; P4, P5: anywhere.
    world
        (6, 3) true places under the photo's camera.
    center, rotation
        (3,), (3, 3) of its camera, world from camera.
    seed
        That it was made with.
    """

    survey: Survey
    world: Floats
    center: Floats
    rotation: Floats
    seed: int

    def known(self, *things: tuple[str, tuple[int, ...]], noise: float = 0.0) -> Lane:
        """The same lane with known things: kind, and corners; their values are the true ones.

        Parameters
        ----------
        *things
            ``length`` is a row of the table of lines.
        noise
            Share of its sigma by which every value that is no condition is wrong, at random.
        """
        rng = np.random.default_rng((self.seed, len(things)))
        ends = np.array([p for kind, p in things if kind == "length"], int).reshape(-1, 2)
        length = np.linalg.norm(self.world[ends[:, 0]] - self.world[ends[:, 1]], axis=1)
        rest = [(kind, p) for kind, p in things if kind != "length"]
        survey = replace(
            self.survey,
            line_start=ends[:, 0],
            line_end=ends[:, 1],
            length_m=length + noise * SIGMA_M * rng.normal(size=len(ends)),
            length_sigma_m=np.full(len(ends), SIGMA_M),
            known=tuple(self._thing(k, *one, noise * rng.normal()) for k, one in enumerate(rest)),
        )
        return replace(self, survey=survey)

    def _thing(self, index: int, kind: str, label: tuple[int, ...], error: float) -> KnownThing:
        """A known thing that is wrong by so many sigmas."""
        sigma = SIGMA_DEG if kind in {"right_angle", "parallel"} else SIGMA_M
        sigma *= 10.0 if kind == "area" else 1.0
        return KnownThing(
            index=index,
            name=f"{kind} {index}",
            kind=kind,
            label=label,
            value=_value(kind, self.world[list(label)]) + sigma * error,
            sigma=sigma,
        )


def _value(kind: str, points: Floats) -> float:
    """True value of (k, 3) points; NaN for conditions."""
    east, north = points[:, 0], points[:, 1]
    if kind == "line_distance":
        (a, b), (c, d) = points[0, :2] - points[1, :2], points[2, :2] - points[1, :2]
        return float(abs(a * d - b * c) / np.hypot(c, d))
    if kind == "area":
        return float(abs(east @ np.roll(north, -1) - north @ np.roll(east, -1)) / 2)
    return float("nan")


def measured(adjustment: Adjustment) -> tuple[float, float]:
    """The distance between the two points that no known thing names, and its sigma."""
    rows = adjustment.label_rows(f"P{k}" for k in MEASURED)
    world, covariance = adjustment.joint_points(rows)
    value, gradient = measurements.distance(world)
    return value, float(np.sqrt(gradient.ravel() @ covariance @ gradient.ravel()))


def true_distance(scene: Lane) -> float:
    first, second = scene.world[list(MEASURED)]
    return float(np.linalg.norm(first - second))


def lane(seed: int, *, noise: float = 0.0) -> Lane:
    """A lane of 3 to 10 m by 6 to 20 m somewhere in a photo from 15 to 40 m, 0 to 50 degrees aside.

    Parameters
    ----------
    seed
        Of the random numbers.
    noise
        Share of their sigmas by which picks, and right angles and parallels of the lane, are wrong:
        the angles at its corners 1 and 2, and thereby the parallels.
    """
    rng = np.random.default_rng(seed)
    while True:
        center = np.array([0.0, 0.0, rng.uniform(15, 40)])
        rotation = look_down(rng.uniform(-np.pi, np.pi), rng.uniform(0, np.deg2rad(50)))
        sight = rotation @ np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), 1.0])
        middle = -sight[:2] / sight[2] * center[2]
        plan = _corners(rng, noise * np.deg2rad(SIGMA_DEG) * rng.normal(size=2))
        plan = np.concatenate([plan, rng.uniform(-10, 10, (2, 2))]) + middle
        world = np.column_stack([plan, np.zeros(6)])
        pixel, depth = cv_pixels(scenes.INTRINSICS, center, rotation, world)
        if (depth > 0).all() and (pixel > 20).all() and (pixel < [1980, 1480]).all():
            break
    empty = make_scene(seed, frames=1, labels=6, ends=(), telemetry=False, gauge="plane")
    survey = replace(
        empty.survey,
        calibration=replace(
            empty.survey.calibration, covariance=scenes.calibration_covariance() * 1e-4
        ),
        pick_frame=np.zeros(6, int),
        pick_label=np.arange(6),
        pixel_px=pixel + noise * scenes.PIXEL_SIGMA * rng.normal(size=(6, 2)),
        pick_sigma_px=np.full(6, scenes.PIXEL_SIGMA),
    )
    return Lane(survey, world, center, rotation, seed)


def _corners(rng: np.random.Generator, error_rad: Floats) -> Floats:
    """(4, 2) about the origin: at corners 1 and 2 right angles, but for errors."""
    sides = rng.uniform([6.0, 3.0], [20.0, 10.0])
    heading = rng.uniform(0, 2 * np.pi)
    way = heading + np.array([0.0, np.pi / 2 + error_rad[0], np.pi + error_rad.sum()])
    step = np.stack([np.cos(way), np.sin(way)], axis=1) * sides[[0, 1, 0], None]
    corners = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    return np.asarray(corners - corners.mean(axis=0))
