"""Surveys drawn for a planned flight, and adjusted: what its layouts really reach.

Everything shared is drawn from its prior, poses about what the log would say, picks and readings
about what they should be; then the real likelihood is minimised, from the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from uavgram.estimation.measuring.propagation import compute_values
from uavgram.estimation.solver.levenberg_marquardt import minimise
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State, advance_state, apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.options import GroundOptions
from uavgram.synthetic.plan.flights import PlannedCameras
from uavgram.synthetic.plan.scene import PlanScene, WantedValues
from uavgram.synthetic.plan.survey import PlannedSurvey, make_survey


@dataclass(frozen=True)
class World:
    """What the plan knows nothing of: relief of each point [m], the tape's scale (one sigma)."""

    relief_m: float = 0.0
    tape_scale: float = 0.0


def errors(
    flown: tuple[PlanScene, PlannedCameras, WantedValues],
    ends_m: Floats,
    count: int,
    rng: np.random.Generator,
    world: World | None = None,
) -> Floats:
    """(n, M) measured less true values of the surveys that came to rest, `count` at most.

    Parameters
    ----------
    flown
        Scene, photos, and what is measured.
    ends_m
        (L, 2, 2) the lines.
    count
        Surveys.
    rng
        Draws them.
    world
        What the plan knows nothing of.
    """
    world = world or World()
    scene, cameras, wanted = flown
    planned = make_survey(scene, cameras, wanted, ends_m)
    truth = planned
    if world.relief_m:
        rough = replace(scene, ground=GroundOptions(roughness_sigma_m=world.relief_m))
        truth = make_survey(rough, cameras, wanted, ends_m)
    to_fit, to_draw = (one.adjust(one.blocks()) for one in (planned, truth))
    asked = wanted.requests, planned.frames
    found = []
    for _ in range(count):
        true, fitted = _one(planned, truth, rng, world)
        if fitted is None:
            continue
        found.append(
            compute_values(to_fit.problem, fitted, *asked)
            - compute_values(to_draw.problem, true, *asked)
        )
    return np.array(found)


def _one(
    planned: PlannedSurvey, truth: PlannedSurvey, rng: np.random.Generator, world: World
) -> tuple[State, State | None]:
    """The unknowns as they truly are in one survey, and as its adjustment finds them."""
    true = _drawn_state(truth, rng, world.relief_m)
    blocks = truth.problem.evaluate(true)
    assert blocks is not None
    survey = planned.problem.survey
    off = blocks["pixels"].residual + rng.standard_normal(blocks["pixels"].residual.shape)
    reading = blocks["lengths"].residual[:, 0] * survey.length_sigma_m + survey.length_m
    reading = reading / (1.0 + world.tape_scale * rng.standard_normal())
    drawn = replace(
        survey,
        pixel_px=survey.pixel_px + off * survey.pick_sigma_px[:, None],
        length_m=reading + survey.length_sigma_m * rng.standard_normal(len(reading)),
    )
    used = np.ones(len(survey.line_start), dtype=np.bool_)
    problem = SurveyProblem(drawn, planned.problem.pivot_m, used)
    found = minimise(
        planned.state,
        problem.evaluate,
        partial(advance_state, problem.layout),
        problem.layout.size,
        problem.layout.structure,
    )
    return true, found.state if found.converged else None


def _drawn_state(planned: PlannedSurvey, rng: np.random.Generator, relief_m: float) -> State:
    """The unknowns as they might truly be: all priors drawn, poses about the log's."""
    layout = planned.problem.layout
    blocks = planned.blocks()
    step = np.zeros(layout.size)
    for name in ("calibration", "plane", *PRIORS):
        if name in blocks:
            block = blocks[name]
            sigma = 1.0 / np.abs(block.jacobian[:, 0, 0])
            step[block.columns[:, 0]] = sigma * rng.standard_normal(len(sigma))
    if "telemetry" in blocks:
        block = blocks["telemetry"]
        shared = np.einsum("nrk,nk->nr", block.jacobian, step[block.columns])
        noise = rng.standard_normal(shared.shape) - shared
        own = np.linalg.solve(block.jacobian[:, :, :6], noise[..., None])[..., 0]
        step[layout.frame_columns(np.arange(layout.frames))] = own
    if relief_m:
        step[2 : layout.first_tie : layout.point_size] = relief_m * rng.standard_normal(
            layout.points
        )
    return apply_increment(layout, planned.state, step)


PRIORS = ("boresight", "lever_arm", "position_bias", "heading_bias", "tape")
