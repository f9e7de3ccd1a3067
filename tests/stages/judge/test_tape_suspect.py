"""A tape that control points contradict is named, with its size and side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scenes import NO_TIMES, Scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.propagation import propagate
from uavgram.model.options import SolveOptions
from uavgram.stages.judge import judge_suspects, run_tests
from uavgram.stages.refine import refine


def test_a_tape_that_is_a_little_long_is_named(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(6, frames=6, labels=14, lines=10, control=8, spread=9.0)
    scene = read_on_tapes(scene, {"red": 0.007}, sigma=0.001)
    refined, _ = refine(scene.survey, SolveOptions(noise="stated"))
    examined = run_tests(refined, propagate(refined.adjustment, (), NO_TIMES), 0.001)
    said = [message.text for message in judge_suspects(examined)]

    assert any("the tape 'red' seems to be 0.64 % too long" in text for text in said)


def test_a_tape_that_is_one_per_cent_long_is_named(scene_factory: Callable[..., Scene]) -> None:
    """Its readings are too short, and take no part: the rest is as if nobody had taped."""
    scene = scene_factory(6, frames=6, labels=14, lines=10, control=8, spread=9.0)
    scene = read_on_tapes(scene, {"red": 0.01}, sigma=0.001)
    names = tuple(f"L{i}" for i in range(10))
    survey = replace(scene.survey, line_name=names)
    refined, messages = refine(survey, SolveOptions(noise="stated"))
    examined = run_tests(refined, propagate(refined.adjustment, (), NO_TIMES), 0.001)
    (said,) = (message for message in messages if message.code == "lengths-factor")

    assert said.text.startswith("All lengths of the tape 'red' seem to be too short by one factor")
    assert "0.9 ± 0.1 %" in said.text
    assert said.lengths == names
    assert refined.line_removed.all()
    assert judge_suspects(examined) == ()
