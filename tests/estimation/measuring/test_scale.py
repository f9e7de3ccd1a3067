"""What a scale rests on, against surveys that leave the other witness out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rolling_scenes import read_in_rows
from scenes import Scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.scale import compute_scale_sigmas
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.options import SolveOptions
from uavgram.stages.measure import describe_scale_basis
from uavgram.stages.refine import refine

Make = Callable[..., Scene]
ALONE = {"telemetry": False, "gauge": "plane", "lines": 8}


def adjusted(scene: Scene) -> Adjustment:
    return refine(scene.survey, SolveOptions())[0].adjustment


@pytest.mark.parametrize("in_rows", [False, True])
@pytest.mark.parametrize("tapes", [(), ("",), ("a", "b")])
def test_the_rest_knows_the_scale_as_well_as_a_tape_that_nobody_knows(
    scene_factory: Make, tapes: tuple[str, ...], *, in_rows: bool
) -> None:
    """The readout time is an unknown behind those of the tapes, of whatever number."""
    scene = scene_factory(4, frames=6, lines=8, spread=20.0)
    scene = read_in_rows(scene, 0.03) if in_rows else scene
    of_known = read_on_tapes(scene, dict.fromkeys(tapes, 0.0), sigma=0.002) if tapes else scene
    of_unknown = read_on_tapes(scene, {"": 0.0}, sigma=1000.0)
    unknown = adjusted(of_unknown)
    at = unknown.problem.layout.first_tape
    # 1 / sigma^2 of the scale = what the rest knows, once the readings' own noise is taken away
    sigma = float(np.sqrt(unknown.shared(at, 1)[0, 0]))

    found = compute_scale_sigmas(adjusted(of_known))
    assert found.others == pytest.approx(sigma, rel=0.02)
    total = np.sum((scene.survey.length_m / scene.survey.length_sigma_m) ** 2)
    own = np.sqrt(1.0 / total + (0.002**2 / len(tapes) if tapes else 0.0))
    assert found.lengths == pytest.approx(own, rel=1e-3)


@pytest.mark.parametrize("roughness_m", [0.0, 0.08])
def test_nothing_else_bears_on_it_without_a_log(scene_factory: Make, roughness_m: float) -> None:
    """The ground is as uneven as the survey is large: that tells nothing of its size."""
    made = scene_factory(8, **ALONE, frames=5, labels=40, roughness=roughness_m)
    scene = read_on_tapes(made, {"": 0.0}, sigma=0.001)
    adjustment = adjusted(scene)

    assert np.isinf(compute_scale_sigmas(adjustment).others)
    (said,) = describe_scale_basis(adjustment)
    assert said.text.startswith("The scale rests on your lengths (± 0.1")
    assert "nothing else confirms it" in said.text


def test_the_sentence_names_what_bears_it(scene_factory: Make) -> None:
    log = describe_scale_basis(adjusted(scene_factory(4, frames=6, lines=8)))[0]
    assert "; the log confirms it to ± " in log.text
    alone = describe_scale_basis(adjusted(scene_factory(4, frames=6, lines=0)))[0]
    assert alone.text.startswith("The scale rests on the log alone: ± ")
    control = scene_factory(4, frames=6, lines=0, control=4, telemetry=False)
    assert (
        "rests on the control points alone: ± " in describe_scale_basis(adjusted(control))[0].text
    )
    both = replace(control, survey=scene_factory(4, frames=6, lines=8, control=4).survey)
    assert "the log and the control points" in describe_scale_basis(adjusted(both))[0].text
    assert {log.level, log.code} == {"info", "scale-basis"}
