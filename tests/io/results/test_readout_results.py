"""A readout time in results.json; and files of versions that knew none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from sample_results import sample_result

from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.camera.tags import Readout
from uavgram.model.result.shared import Estimate


def test_readout_and_sweep_come_back(tmp_path: Path) -> None:
    result = sample_result()
    sweep = np.arange(6.0 * len(result.frames.frame_id)).reshape(-1, 6)
    known = Readout(value_s=0.033, sigma_s=0.005)
    result = replace(
        result,
        camera=replace(result.camera, readout=known),
        frames=replace(result.frames, sweep=sweep),
        shared=replace(
            result.shared,
            readout_s=Estimate(value=np.array([0.031]), sigma=np.array([0.004])),
        ),
    )
    write_results(result, tmp_path / "results.json")
    content = json.loads((tmp_path / "results.json").read_text())
    again = load_results(tmp_path / "results.json")

    assert content["shared"]["readout_s"] == {"value": 0.031, "sigma": 0.004}
    assert again.camera.readout == known
    assert again.shared.readout_s is not None
    assert again.shared.readout_s.value[0] == 0.031
    np.testing.assert_array_equal(again.frames.sweep, sweep)
