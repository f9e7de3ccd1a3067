"""Finds that nobody has accepted give their photos a pose, and contradict a wrong one."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from flight_projects import copy_project

from uavgram.picking.document.state import Line, Pick, State
from uavgram.picking.session.adjustment_workers import collect_observations
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.pick.places import predict_places
from uavgram.stages.match import CONTRADICTED, Found

PHOTO, OTHER = "IMG_0027.jpg", "IMG_0028.jpg"


@pytest.mark.parametrize("log", [None, "turned"])
def test_a_photo_with_finds_alone_is_placed_and_a_wrong_find_is_named(
    data_dir: Path, tmp_path: Path, log: str | None
) -> None:
    """Also beside a log whose photos are turned by 180 degrees: it takes no part."""
    street = data_dir / "street_oblique"
    truth = json.loads((data_dir / "truth" / "street_oblique.json").read_text())
    here, there = (truth["pixels"][photo] for photo in (PHOTO, OTHER))
    labels = [
        label
        for label in sorted(here)
        if label[0] in "RP"
        and here[label][2]
        and there.get(label, (0, 0, False))[2]
        and abs(truth["height_above_ground_m"][label]) < 0.02
    ][::3]
    picks = tuple(
        Pick(image=PHOTO, label=one, u_px=here[one][0], v_px=here[one][1], sigma_px=0.5)
        for one in labels
    )
    lines = tuple(
        Line(
            name=f"L{k}",
            start=a,
            end=b,
            length_m=math.dist(truth["points"][a], truth["points"][b]),
            sigma_m=0.01,
        )
        for k, (a, b) in enumerate(pairwise(labels))
    )
    changes = {"mount": {"gimbal": "none", "yaw_deg": 180.0, "pitch_deg": -45.0}} if log else {}
    without = {"log": None, "time": None} if log is None else {}
    files = dict.fromkeys(("picks", "lines", "measure", "control", "check"))
    survey = LiveSurvey.open(
        copy_project(street, tmp_path, **files | changes | without | {"picks": "picks.csv"})
    )
    observed = collect_observations(State(picks=picks, lines=lines))
    last = survey.adjust(observed)
    found = {
        (OTHER, one): Found(k, (there[one][0], there[one][1]), 0.1, 0.95, 5.0)
        for k, one in enumerate(labels[:-1])
    }
    wrong = OTHER, labels[2]
    u, v = found[wrong].pixel_px
    adjusted, contradicted = survey.adjust_with_finds(last, found)
    _, misled = survey.adjust_with_finds(
        last, found | {wrong: Found(2, (u + 12.0, v), 0.1, 0.95, 5.0)}
    )

    assert contradicted == {}
    assert misled[wrong] == CONTRADICTED
    places = predict_places(survey, adjusted, observed.picks)
    assert places is not None
    row = list(zip(places.image, places.label, strict=True)).index((OTHER, labels[-1]))
    off = places.predicted.pixel_px[places.row[row]] - there[labels[-1]][:2]
    assert np.linalg.norm(off) < min(places.radius_px[row], 5.0)
