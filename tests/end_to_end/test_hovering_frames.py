"""Frames of a video from a drone that hovers, at Narrabeen: picked in one, found in the others.

Nothing says where they were taken: the lengths between the targets place the frame that was picked
in, and ties say how the others are turned from it. The targets lie nearly in a line, so that the
height of the camera is known to metres only; so are the heights that the frames show.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
from csv_rows import read_rows
from published_scenes import camera_file, narrabeen_targets, write_project

from uavgram.pipeline.match.run import match_picks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.picks_table import write_ties

LENS = (3320, 3319, 1758, 1090, 0.01638, 0.02744, -0.01, 0, 0.00105)
LENS_SIGMA = (10, 10, 10, 10, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3)
LENGTH_SIGMA_M = 0.03
HEIGHT_M = 98.3 - 2.475
"""Of the camera above the targets, as published with them (mean of the whole video)."""

NEAR_PX = 0.3
"""Of the places that another program's tracking gave: worst measured 0.22."""


def test_labels_of_one_frame_are_found_in_the_others(data_dir: Path, tmp_path: Path) -> None:
    scene = narrabeen_targets(data_dir / "narrabeen_mavic")
    first, *others = sorted(name for name in scene.pixels if "Frames" in name)
    lines = [
        (
            f"{a}-{b}",
            a,
            b,
            np.linalg.norm(scene.world[a] - scene.world[b]),
            LENGTH_SIGMA_M,
            "adjust",
        )
        for a, b in combinations(scene.world, 2)
    ]
    project = write_project(
        tmp_path,
        camera_file((3840, 2160), LENS, LENS_SIGMA),
        [(first, name, *uv) for name, uv in scene.pixels[first].items()],
        lines,
        images=str(scene.folder / "frames/*.jpg"),
        ground={"slope_sigma_deg": 0.5, "roughness_sigma_m": 0.1},
        ties="ties.csv",
    )
    (tmp_path / "ties.csv").write_text("image,tie,u_px,v_px,sigma_px\n", encoding="utf-8")
    write_ties(project)
    match_picks(project)
    found = [row for row in read_rows(tmp_path / "picks.csv") if row["source"] == "match"]

    assert {row["image"] for row in found} == set(others)
    assert len(found) == len(others) * len(scene.world)
    for row in found:
        tracked = scene.pixels[row["image"]][row["label"]]
        away = np.hypot(float(row["u_px"]) - tracked[0], float(row["v_px"]) - tracked[1])
        assert away < NEAR_PX

    result = compute(read_inputs(project), curved=False).result
    assert result.solution.converged
    assert not {"ground-not-plane", "not-converged"} & {one.code for one in result.messages}
    assert np.abs(result.lines.adjusted_m - result.lines.length_m).max() < LENGTH_SIGMA_M
    refined = result.frames.refined
    above = refined.center_world_m[:, 2] - HEIGHT_M
    assert (np.abs(above) < 3.0 * np.sqrt(refined.covariance[:, 2, 2])).all()
