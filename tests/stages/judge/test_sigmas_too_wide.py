"""Everything fits far better than stated: it is said, with the groups that are too wide."""

from __future__ import annotations

from scenes import make_scene

from uavgram.estimation.survey.observations.lengths import Lengths
from uavgram.estimation.survey.observations.pixels import Pixels
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.stages.judge.fit import _report_misfit, judge_groups
from uavgram.stages.messages import order_messages
from uavgram.stages.refine import refine


def messages_of(noise: float) -> tuple[Message, ...]:
    scene = make_scene(5, frames=4, labels=14, noise=noise)
    refined, _ = refine(scene.survey, SolveOptions(noise="stated"))
    return judge_groups(refined.adjustment, 0.001)[1]


def test_sigmas_far_too_wide_are_told() -> None:
    (message,) = messages_of(noise=0.4)

    assert message.code == "sigmas-too-wide"
    assert "The errors are 0.41 times the stated ones (picks 0.43, " in message.text
    assert "stated errors may be too large" in message.text
    assert "No action is needed" in message.text


def test_groups_that_fit_worse_than_stated_are_one_message() -> None:
    (message,) = order_messages(
        _report_misfit(Pixels.kind, Pixels.kind.check, 3.0, 1e-7),
        _report_misfit(Lengths.kind, Lengths.kind.check, 2.0, 1e-4),
    )

    assert message.text == (
        "2 kinds of observations do not fit as well as their stated errors promise: picks: look at "
        "their labels, and their stated error (their errors are 1.7 times "
        "as large as stated; chance alone does this less than 1 in a million times); known "
        "lengths: look at their readings and stated errors (their errors are 1.4 times as large as "
        "stated; chance alone does this 1 in 10000 times). Until this is cleared up, the "
        "uncertainties of the results are too small."
    )


def test_sigmas_as_they_are_say_nothing() -> None:
    assert messages_of(noise=1.0) == ()
