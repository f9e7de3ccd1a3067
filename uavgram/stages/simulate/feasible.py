"""What makes a scenario senseless: found before anything is repeated, and named by its key."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.scenario.simulated import SimulatedSurvey


class SenselessKey(NamedTuple):
    """A key of the scenario, from its root, and what is wrong with it."""

    key: tuple[str | int, ...]
    text: str


def senseless(survey: SimulatedSurvey) -> Iterator[SenselessKey]:
    """Find what makes no sense in a survey without errors.

    Parameters
    ----------
    survey
        As `simulate` gives it with `exact`.
    """
    scenario, truth = survey.scenario, survey.truth
    offset = truth.center_world_m[:, :2] - truth.surface.middle_m
    ground_m = truth.surface.height_m + offset @ truth.surface.slope
    for i in np.flatnonzero(truth.center_world_m[:, 2] <= ground_m + 1.0)[:1].tolist():
        above = float(truth.center_world_m[i, 2] - ground_m[i])
        text = (
            f"{'is below' if above <= 0 else 'is hardly above'} the ground: the camera of photo "
            f"{i + 1} would be {above:.1f} m above it. Fly higher (heights are above home; the "
            f"ground there is at {ground_m[i]:.1f} m)"
        )
        yield SenselessKey(_of_photo(scenario, i, "height_m"), text)
        return
    for i in np.flatnonzero(_sees_horizon(survey))[:1].tolist():
        text = (
            f"photo {i + 1} would show the horizon, and nothing can be measured near it: tilt the "
            "camera further down (-90 is straight down)"
        )
        yield SenselessKey(_of_photo(scenario, i, "gimbal_pitch_deg"), text)
        return
    yield from _unseen(survey)


def _of_photo(scenario: Scenario, photo: int, key: str) -> tuple[str | int, ...]:
    """The key that says where a photo is taken, or how."""
    plan = scenario.flight
    if plan.pattern == "poses":
        return "flight", "poses", photo, {"gimbal_pitch_deg": "pitch_deg"}.get(key, key)
    if plan.pattern == "orbit" and key == "gimbal_pitch_deg":
        return "flight", "radius_m"
    return "flight", key


def _sees_horizon(survey: SimulatedSurvey) -> Bools:
    """(F,) whether a corner of the photo looks at the sky, or so far that it might as well."""
    camera = survey.calibration
    w, h = camera.width_px - 1.0, camera.height_px - 1.0
    corner = np.array([[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]])
    ray = back_project(camera.model, survey.truth.intrinsics, corner)
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    up = np.einsum("fj,kj->fk", survey.truth.world_from_camera[:, 2], ray)
    return np.asarray((np.isnan(up) | (up > -np.sin(np.deg2rad(3.0)))).any(axis=1))


def _unseen(survey: SimulatedSurvey) -> Iterator[SenselessKey]:
    """Lengths and measurements of which no photo shows what they need."""
    scenario, seen = survey.scenario, set(survey.picks.label)
    if not seen:
        text = "no photo shows any of them: fly over the scene, whose middle is x 0, y 0"
        yield SenselessKey(("points",), text)
        return
    used = [line for line in scenario.lines if line.use == "adjust"]
    shown = [line for line in used if {line.start, line.end} <= seen]
    if used and not shown:
        text = f"no line is in view: no photo shows both ends of {used[0].name!r}" + (
            "" if len(used) == 1 else f", nor of the {len(used) - 1} others"
        )
        yield SenselessKey(("lines",), f"{text}. Lay them where the photos look, or fly over them")
    plates = seen.intersection(scenario.plates.labels)
    if not shown and not plates and scenario.telemetry == "none" and len(scenario.control) < 2:
        text = (
            "is none, and there is no length, plate or control point in view: nothing says how "
            "large anything is. Give lines, plates, control or a log"
        )
        yield SenselessKey(("telemetry",), text)
    if not any(set(one.points) <= seen for one in scenario.measurements):
        text = "no photo shows all points of any of them: there is nothing to repeat"
        yield SenselessKey(("measurements",), text)
