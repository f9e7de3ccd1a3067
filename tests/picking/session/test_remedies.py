"""The button beside a reason: pressed, it puts the survey right, and the verdict gets better."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import NamedTuple

import hostile_faults as faults
import hostile_length_faults as lengths
import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_faults import Fault, Sound
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.model.result.reliability import VerdictLevel
from uavgram.picking.document.commands import All
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import State, make_observations, make_state
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_verdict import verdict_json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.pipeline.pick.live_survey import LiveSurvey, Observations

POOR = Condition(labels=7, photos=3, picked_share=1.0, radius_m=10.0)
ORDER: tuple[VerdictLevel, ...] = ("green", "amber", "red")
IN_FEET = partial(lengths.one_length, reading=lengths.in_feet)
TRANSPOSED = partial(lengths.one_length, reading=lengths.transposed)
RAISED = partial(faults.raised_label, from_m=1.0, to_m=2.0)
GROSS = partial(faults.gross_pick, far_px=60.0)
CLICKED_ELSEWHERE = partial(faults.clicked_elsewhere, both=False)


class Project(NamedTuple):
    """A survey with a fault, open; and its photos, as messages name them."""

    live: LiveSurvey
    photos: tuple[PhotoSize, ...]

    def verdict(self, state: State) -> m.Verdict:
        """What the page is told of a state."""
        picks, lines = make_observations(state)
        requests = self.live.inputs.requests
        found = self.live.adjust(Observations(picks=picks, lines=lines, requests=requests))
        index = {photo.name: k for k, photo in enumerate(self.photos)}
        return verdict_json(found.result, lines, index)

    def pressed(self, state: State, mend: m.Mend) -> State:
        """The state after a button, as the page sends it."""
        text = json.dumps({"seq": 1, "t": "all", "changes": mend["changes"]})
        command = parse_message(text, self.photos).body
        assert isinstance(command, All)
        return apply_change(state, command)


def opened(folder: Path, fault: Fault, seed: int) -> tuple[Project, State]:
    sound = Sound(make_survey(POOR, seed), POOR, seed, np.random.default_rng([seed, 99]))
    path = write_project(fault(sound).survey, folder, heights="unstated")
    inputs = LiveSurvey.open(path).inputs
    sizes = zip(
        inputs.photos.frame_id, inputs.photos.width_px, inputs.photos.height_px, strict=True
    )
    photos = tuple(PhotoSize(name, round(float(w)), round(float(h))) for name, w, h in sizes)
    return Project(LiveSurvey(inputs), photos), make_state(
        inputs.picks, inputs.lines, inputs.requests
    )


@pytest.mark.parametrize(
    ("fault", "seed", "code", "plain", "button"),
    [
        (faults.swapped_once, 3, "labels-swapped", "P2 and P5 seem swapped in ", "Swap P2 and P5"),
        (CLICKED_ELSEWHERE, 6, "label-elsewhere", "P0 is picked where P2 b", "Change P0 to P2 in"),
        (IN_FEET, 0, "line-wrong-unit", "L0 seems to be in feet", "Take L0 as feet: 10.21 m"),
        (
            TRANSPOSED,
            3,
            "line-wrong-digit",
            "L3 seems misread: it is written as 4.56",
            "Correct L3",
        ),
        (lengths.other_ends, 0, "line-other-ends", "L0 seems to be b", "Take L0 from P2 to P6"),
        (RAISED, 0, "point-off-ground", "P0 is 1.1 m above the ground.", "Free the height of P0"),
        (GROSS, 5, "pick-left-out", "The pick of P0 in ", "Remove the pick of P0 in "),
    ],
)
def test_the_button_beside_the_first_reason_makes_the_verdict_better(
    tmp_path: Path, fault: Fault, seed: int, code: str, plain: str, button: str
) -> None:
    project, state = opened(tmp_path, fault, seed)
    before = project.verdict(state)
    first = before["first"]
    (mend,) = first["mends"]
    after = project.verdict(project.pressed(state, mend))

    assert first["code"].startswith(code)
    assert first["plain"].startswith(plain)
    assert mend["words"].startswith(button)
    assert first["show"] is not None
    assert ORDER.index(after["level"]) < ORDER.index(before["level"])
    assert not [one for one in after["why"] if one["code"] == first["code"]]
