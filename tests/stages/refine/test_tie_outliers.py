"""Matches and ties that do not fit the others are left out before anything rests on them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hostile_conditions import CONDITIONS
from hostile_project import tie_picks, write_project
from hostile_surveys import HostileSurvey, make_survey

from uavgram.model.arrays import Floats
from uavgram.model.survey import TiePicks
from uavgram.pipeline.measure.compute import Computation, compute
from uavgram.pipeline.measure.inputs import read_inputs


@cache
def made() -> HostileSurvey:
    return make_survey(replace(CONDITIONS["matched_tied"], wrong_found=0.0, ties=150), 3)


@cache
def computed(*, match_off_px: float = 0.0, tie_off_px: float = 0.0) -> Computation:
    """The survey with the first match, and the first tie's first sighting, off by so much."""
    survey = made()
    with TemporaryDirectory() as folder:
        inputs = read_inputs(write_project(survey, Path(folder)))
        ties = tie_picks(survey)
        ties = replace(ties, pixel_px=moved(ties.pixel_px, first_tie(ties), tie_off_px))
        match = int(np.flatnonzero(inputs.picks.of_source("match"))[0])
        picks = replace(inputs.picks, pixel_px=moved(inputs.picks.pixel_px, match, match_off_px))
        return compute(replace(inputs, ties=ties, picks=picks), curved=False)


def first_tie(ties: TiePicks) -> int:
    """A sighting of a tie point that four photos or more show."""
    return next(i for i, name in enumerate(ties.tie) if ties.tie.count(name) >= 4)


def moved(pixel_px: Floats, row: int, by_px: float) -> Floats:
    other = np.array(pixel_px)
    other[row] += by_px
    return other


def test_nothing_is_left_out_where_all_is_right() -> None:
    result = computed().result

    codes = {message.code for message in result.messages}
    assert not codes & {"match-left-out", "ties-left-out", "match-stale"}
    assert "removed" not in result.picks.status
    noise = {one.source: one for one in result.noise.picks} if result.noise else {}
    assert noise.keys() == {"hand", "match", "tie"}
    for source in ("match", "tie"):
        assert abs(noise[source].factor - 1.0) < 4 * noise[source].sigma


def test_a_wrong_match_is_left_out_by_name_and_a_wrong_tie_is_counted() -> None:
    result = computed(match_off_px=4.0, tie_off_px=4.0).result

    match = result.picks.status.index("removed")
    assert result.picks.status.count("removed") == 1
    told = [message for message in result.messages if message.code == "match-left-out"]
    assert [(m.frames, m.labels) for m in told] == [
        ((result.picks.image[match],), (result.picks.label[match],))
    ]
    counted = [message for message in result.messages if message.code == "ties-left-out"]
    assert [m.text.split()[0] for m in counted] == ["1"]


def test_matches_have_residuals_of_their_own_size() -> None:
    result = computed().result

    found = np.array([status == "used" for status in result.picks.status])
    is_match = np.isclose(result.picks.sigma_px, 0.06)
    residual = result.picks.residual_px[found & is_match]
    assert len(residual) > 100
    assert 0.03 < np.sqrt(np.mean(residual**2)) < 0.08
