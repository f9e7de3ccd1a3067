"""Each row says how far it can be trusted, and the smallest error that would show in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from standings import with_status

from uavgram.model.camera import PARAMETER_NAMES
from uavgram.model.result.reliability import Reason, Verdict, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.model.result.tables import LineStatus, PickStatus
from uavgram.picking.protocol.encode_statuses import (
    describe_unchecked,
    describe_undetectable,
    encode_length_statuses,
    encode_photo_statuses,
    encode_point_statuses,
)
from uavgram.picking.protocol.encode_verdict import encode_measurement_statuses


@pytest.fixture
def clean() -> Result:
    """In order, with a last length in which any reading would show."""
    made = survey.build(clean=True)
    used: LineStatus = "used"
    lines = replace(made.lines, status=(used,) * len(made.lines.name))
    return replace(made, lines=replace(lines, mdb_m=np.full(len(lines.name), 0.05)))


WRONG = Reason(cause="misfit", text="Something is wrong.")


def test_what_the_verdict_names_is_doubtful_and_says_why(clean: Result) -> None:
    label, name = clean.points.label[0], clean.lines.name[0]
    image = clean.frames.frame_id[clean.frames.status.index("refined")]
    reason = replace(WRONG, labels=(label,), lengths=(name,), frames=(image,))
    made = replace(clean, verdict=Verdict(level="amber", reasons=(reason,)))
    photos = dict(zip(made.frames.frame_id, encode_photo_statuses(made), strict=True))

    told = (encode_point_statuses(made)[label], encode_length_statuses(made)[0], photos[image])
    for one in told:
        assert (one["status"], one["why"]) == ("doubtful", "Something is wrong.")
    assert encode_length_statuses(made)[1]["status"] == "ok"


def test_of_a_red_result_nothing_that_takes_part_is_in_order(clean: Result) -> None:
    label = clean.points.label[0]
    red = Verdict(level="red", reasons=(replace(WRONG, labels=(label,)),))
    made = with_status(replace(clean, verdict=red), "not-checked")
    points = encode_point_statuses(made)

    assert points[label]["status"] == "contradicted"
    others = [one["status"] for name, one in points.items() if name != label]
    others += [one["status"] for one in encode_length_statuses(made)]
    others += [one["status"] for one in encode_measurement_statuses(made) if one["words"]]
    assert set(others) == {"doubtful"}
    for status, one in zip(made.frames.status, encode_photo_statuses(made), strict=True):
        assert (one["status"] == "ok") == (status not in ("refined", "rejected"))


def test_a_point_that_nothing_checks_says_so(clean: Result) -> None:
    picks = clean.picks
    used: PickStatus = "used"
    count = len(picks.label)
    blind = replace(picks, redundancy=np.zeros(count), status=(used,) * count)

    for one in encode_point_statuses(replace(clean, picks=blind)).values():
        assert one["status"] == "not-checked"
        assert "a wrong click here would not show" in one["why"]


def test_a_length_says_from_what_error_on_it_would_tell(clean: Result) -> None:
    seen = encode_length_statuses(clean)[0]

    assert seen["status"] == "ok"
    assert seen["shows"].startswith("an error shows from 5.0 cm on")
    assert describe_undetectable(clean) == ""


@pytest.mark.parametrize("mdb_m", [0.21, float("nan")])
def test_a_length_in_which_a_decimetre_would_not_show_is_not_trusted(
    clean: Result, mdb_m: float
) -> None:
    mdb = np.append(mdb_m, clean.lines.mdb_m[1:])
    made = replace(clean, lines=replace(clean.lines, mdb_m=mdb))
    first = encode_length_statuses(made)[0]

    assert first["status"] == "not-checked"
    assert ("0.21 m" in first["shows"] or "21.0 cm" in first["shows"]) == np.isfinite(mdb_m)
    assert "A tape read 0.10 m wrong would not show" in describe_undetectable(made)
    assert clean.lines.name[0] in describe_undetectable(made)


def test_a_measurement_that_nothing_checks_says_what_would_not_show() -> None:
    rows = with_status(survey.build(), "not-checked", "ok").measurements
    count, label = len(rows.name), rows.points[0][0]
    links = WeakestLinks(
        what=("",) * count,
        bias=np.full(count, np.nan),
        unit=("",) * count,
        change=np.full(count, np.nan),
        unchecked=(("pick of 'other' in 'a.jpg'", f"pick of {label!r} in 'a.jpg'"),) * count,
    )

    shows = describe_unchecked(rows, links)
    told = describe_unchecked(rows, replace(links, unchecked=(("fx",),) * count))
    assert shows[0] == (
        f"no error would show in the pick of {label!r} in 'a.jpg', nor in 1 other given value"
    )
    assert told[0] == "no error would show in the camera's focal length"
    assert not any(shows[1:])


@pytest.mark.parametrize("name", sorted({*PARAMETER_NAMES["brown"], *PARAMETER_NAMES["fisheye"]}))
def test_a_parameter_of_the_camera_is_called_by_words_not_by_its_letter(name: str) -> None:
    rows = with_status(survey.build(), "not-checked", "ok").measurements
    count = len(rows.name)
    nothing = np.full(count, np.nan)
    links = WeakestLinks(
        what=("",) * count, bias=nothing, unit=("",) * count, change=nothing,
        unchecked=((name,),) * count,
    )  # fmt: skip

    assert f"the {name}" not in describe_unchecked(rows, links)[0]
