"""A tape that control points contradict is named, with its size and side."""

from __future__ import annotations

from collections.abc import Callable

from scenes import NO_TIMES, Scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.propagation import propagate
from uavgram.model.options import SolveOptions
from uavgram.stages.judge import judge_suspects, run_tests
from uavgram.stages.refine import refine


def test_a_tape_that_is_one_per_cent_long_is_named(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(6, frames=6, labels=14, lines=10, control=8, spread=9.0)
    scene = read_on_tapes(scene, {"red": 0.01}, sigma=0.001)
    refined, _ = refine(scene.survey, SolveOptions(noise="stated"))
    examined = run_tests(refined, propagate(refined.adjustment, (), NO_TIMES), 0.001)
    said = [message.text for message in judge_suspects(examined)]

    assert any("the tape 'red' seems to be 0.94 % too long" in text for text in said)
