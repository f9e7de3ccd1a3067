"""A street photographed by a rolling shutter of 30 ms, rendered row by row by another program.

The project's own picks show each point in one photo only, which does not tell the readout time.
So the points on the ground are picked here in all photos that show them, with noise.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

PICK_PX = 0.8
MARGIN_PX = 20


@pytest.fixture(scope="module")
def truth(data_dir: Path) -> dict[str, Any]:
    file = data_dir / "truth" / "street_rolling.json"
    if not file.is_file():
        pytest.skip(f"no street with a rolling shutter at {file}")
    content: dict[str, Any] = json.loads(file.read_text())
    return content


@pytest.fixture(scope="module")
def result(
    data_dir: Path, truth: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> Result:
    folder, source = tmp_path_factory.mktemp("street"), data_dir / "street_rolling"
    rng = np.random.default_rng(3)
    width, height = 2400, 1800
    with (folder / "picks.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["image", "label", "u_px", "v_px", "sigma_px"])
        for image, places in truth["pixels"].items():
            for label, (u, v, visible) in places.items():
                inside = MARGIN_PX < u < width - MARGIN_PX and MARGIN_PX < v < height - MARGIN_PX
                if visible and inside and label[0] in "RP":
                    du, dv = PICK_PX * rng.normal(size=2)
                    table.writerow([image, label, u + du, v + dv, PICK_PX])
    text = (source / "project.yaml").read_text()
    for name in ("photos/*.jpg", "flight.BIN", "camera.yaml", "lines.csv", "measure.csv"):
        text = text.replace(f" {name}", f" {source.resolve() / name}")
    (folder / "project.yaml").write_text(text)
    return compute(read_inputs(folder / "project.yaml"), curved=False).result


def test_the_readout_time_is_learnt(result: Result, truth: dict[str, Any]) -> None:
    readout = result.shared.readout_s
    assert readout is not None

    assert readout.sigma[0] < 0.005
    assert abs(readout.value[0] - truth["readout_s"]) < 3 * readout.sigma[0]


def test_distances_are_as_good_as_their_sigmas_say(result: Result, truth: dict[str, Any]) -> None:
    measured = result.measurements
    errors = []
    for kind, points, value, sigma in zip(
        measured.kind, measured.points, measured.value, measured.sigma, strict=True
    ):
        if kind == "distance" and np.isfinite(value):
            start, end = (np.array(truth["points"][label]) for label in points)
            errors.append((value - np.linalg.norm(end - start)) / sigma)

    assert len(errors) > 30
    assert np.sqrt(np.mean(np.square(errors))) < 1.5  # 3.4 where all rows count as one instant
