"""What a survey found and nobody stated: told beyond chance, with its sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rolling_scenes import read_in_rows
from scenes import make_scene

from uavgram.estimation.survey.observed import add_readout
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine
from uavgram.stages.refine.remarks import report_learnt

LEARNT = {"shutter-found", "ground-slopes"}


def test_a_shutter_is_told_with_its_time() -> None:
    for readout_s, codes in ((0.05, ["shutter-found"]), (0.0, [])):
        scene = read_in_rows(make_scene(2, frames=10, labels=24, lines=8), readout_s)
        assert scene.survey.telemetry is not None
        survey = add_readout(scene.survey, np.zeros(12))
        refined, messages = refine(survey, SolveOptions())
        told = [message for message in messages if message.code in LEARNT]
        assert [message.code for message in told] == codes
        if told:
            found = 1e3 * refined.adjustment.state.readout[0]
            assert f"{found:.0f} ±" in told[0].text
            assert abs(found - 50.0) < 15.0


def test_a_slope_beyond_what_people_call_level_is_told() -> None:
    adjustment = refine(make_scene(2, frames=8, labels=20, lines=6).survey, SolveOptions())[
        0
    ].adjustment
    for east_deg, north_deg, told in ((4.0, 3.0, "slopes by 5.0 ±"), (0.6, 0.8, "")):
        plane = np.array(adjustment.state.plane)
        plane[1:] = np.tan(np.radians([east_deg, north_deg]))
        state = replace(adjustment.state, plane=plane)
        sloping = replace(adjustment, minimum=replace(adjustment.minimum, state=state))
        texts = [m.text for m in report_learnt(sloping) if m.code == "ground-slopes"]
        assert len(texts) == bool(told)
        assert all(told in text for text in texts)
