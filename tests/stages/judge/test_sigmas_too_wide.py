"""Everything fits far better than stated: it is said, with the groups that are too wide."""

from __future__ import annotations

from scenes import make_scene

from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.stages.judge.groups import judge_groups
from uavgram.stages.refine import refine


def messages_of(noise: float) -> tuple[Message, ...]:
    scene = make_scene(5, frames=4, labels=14, noise=noise)
    refined, _ = refine(scene.survey, SolveOptions(noise="stated"))
    return judge_groups(refined.adjustment, 0.001)[1]


def test_sigmas_far_too_wide_are_told() -> None:
    (message,) = messages_of(noise=0.4)

    assert message.code == "sigmas-too-wide"
    assert "variance factor 0.1" in message.text
    assert "picks (0.1" in message.text
    assert "far too wide" in message.text


def test_sigmas_as_they_are_say_nothing() -> None:
    assert messages_of(noise=1.0) == ()
