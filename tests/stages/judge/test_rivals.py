"""Readings that may be wrong in place of those that were left out, in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from uavgram.estimation.survey.adjustment import Reading, Refined, Rival
from uavgram.model.message import Message
from uavgram.stages.judge import suspects


def _length(name: str) -> Reading:
    return Reading("lengths", name, f"the length {name!r}", (f"{name}a", f"{name}b"))


def test_readings_that_are_wrong_only_together_are_one_choice_of_the_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, *two = map(_length, ("D1", "D2", "D3"))
    refined = SimpleNamespace(
        settled=frozenset(),
        contested=(one,),
        rivals=(Rival(tuple(two), (one,)), Rival((*two, one), (one,))),
        possible=(),
        adjustment=None,
    )
    monkeypatch.setattr(suspects, "is_mount_open", lambda _: False)
    (message,) = suspects.judge_rivals(cast("Refined", refined))

    assert message.text.startswith(
        "One of these is wrong: the length 'D1', the length 'D2' and the length 'D3' (both) or the "
        "length 'D2', the length 'D3' and the length 'D1' (all of them). All the rest fits"
    )
    assert "together with" not in message.text
    assert message.plain == ""


@pytest.mark.parametrize(("mounts", "plain"), [(0, "L4 does not fit."), (1, "")])
def test_a_length_that_is_named_alone_is_not_one_of_several(
    mounts: int, plain: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    refined = SimpleNamespace(
        settled=frozenset(),
        contested=(_length("L4"),),
        left_out=(_length("L4"),),
        rivals=(),
        possible=(Message("warning", "labels-swapped", "The labels 'P8' and 'P11' seem swapped."),),
        adjustment=None,
    )
    monkeypatch.setattr(suspects, "is_mount_open", lambda _: mounts > 0)
    (message,) = suspects.judge_rivals(cast("Refined", refined))

    assert message.plain == plain
