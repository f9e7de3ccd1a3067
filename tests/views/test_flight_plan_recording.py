"""The recording of a plan, read back: what lies where, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from planned_sample import GROUND_M, bare_plan, sample_plan
from recording_contents import Contents

from uavgram.errors import OutputError
from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.views.flight_plan_recording import write_plan_recording

PLAN = sample_plan()


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("plan") / "plan.rrd"
    write_plan_recording(PLAN, path)
    return Contents(path)


def strips(contents: Contents, entity: str) -> list[Floats]:
    return [np.array(strip) for strip in contents.static[entity]["LineStrips3D:strips"]]


def test_pyramids_stand_at_the_photos_and_look_at_what_they_show(contents: Contents) -> None:
    frames = PLAN.frames
    for k, pyramid in enumerate(strips(contents, "/plan/photos")):
        apex = pyramid[5]
        np.testing.assert_allclose(apex, frames.center_world_m[k], atol=1e-4)
        rays = pyramid[:4] - apex
        seen = apex + rays * ((GROUND_M - apex[2]) / rays[:, 2])[:, None]
        nearest = np.linalg.norm(seen[:, None] - frames.footprint_world_m[k][None], axis=2)
        assert nearest.min(axis=1).max() < 0.05  # half a pixel is 1 cm and more on the ground
        assert sorted(nearest.argmin(axis=1)) == [0, 1, 2, 3]


def test_the_timeline_goes_through_the_photos(contents: Contents) -> None:
    shown = contents.by_frame["/plan/this_photo"]["LineStrips3D:strips"]
    assert sorted(shown) == list(range(len(PLAN.frames.name)))
    for k, (pyramid,) in shown.items():
        np.testing.assert_allclose(pyramid[5], PLAN.frames.center_world_m[k], atol=1e-4)
    sheets = contents.by_frame["/documents/photo"]["TextDocument:text"]
    assert all(PLAN.frames.name[k] in text[0] for k, text in sheets.items())


def test_the_map_has_a_cell_wherever_something_can_be_measured(contents: Contents) -> None:
    mesh = contents.static["/plan/accuracy"]
    known = np.isfinite(PLAN.grid.sigma_m)
    corners = np.array(mesh["Mesh3D:vertex_positions"]).reshape(-1, 4, 3)
    assert len(corners) == known.sum()
    np.testing.assert_allclose(
        corners.mean(axis=1)[:, :2], PLAN.grid.center_world_m[known, :2], atol=1e-4
    )
    assert (corners[..., 2] < GROUND_M).all()
    triangles = np.array(mesh["Mesh3D:triangle_indices"]).reshape(-1, 2, 3)
    of_both = corners.reshape(-1, 3)[triangles].mean(axis=(1, 2))  # they fill the cell
    np.testing.assert_allclose(of_both, corners.mean(axis=1), atol=1e-4)
    packed = np.array(mesh["Mesh3D:vertex_colors"], dtype=np.uint32)[::4]
    brightness = np.sum([(packed >> shift) & 255 for shift in (24, 16, 8)], axis=0)
    sigma = PLAN.grid.sigma_m[known]
    assert brightness[np.argmin(sigma)] < brightness[np.argmax(sigma)]


def test_lines_to_lay_and_their_names(contents: Contents) -> None:
    drawn = strips(contents, "/plan/lines_to_lay")
    np.testing.assert_allclose([s[0] for s in drawn], PLAN.lines.start_world_m, atol=1e-4)
    np.testing.assert_allclose([s[1] for s in drawn], PLAN.lines.end_world_m, atol=1e-4)
    names = contents.static["/plan/names"]["Points3D:labels"]
    assert {"L1 14.2 m", "L5 12.9 m", "keep out"} <= set(names)
    told = contents.static["/documents/lines"]["TextDocument:text"][0]
    assert "1.2 m from corner 1 towards corner 2" in told


def test_the_first_page_says_what_to_do_and_what_comes_of_it(contents: Contents) -> None:
    told = contents.static["/documents/summary"]["TextDocument:text"][0]
    assert told.startswith("# Lay and tape 5 lines, then take 6 photos")
    assert "impact \\<to\\> kerb" in told
    assert "a sixth line" in told


def test_in_feet_and_of_photos_alone(tmp_path: Path) -> None:
    path = tmp_path / "plan.rrd"
    write_plan_recording(bare_plan(), path, Units(length="ft", speed="mph"))
    bare = Contents(path)
    told = bare.static["/documents/summary"]["TextDocument:text"][0]
    assert "131 ft above the ground" in told
    assert "/plan/accuracy" not in bare.static
    assert "/plan/lines_to_lay" not in bare.static


def test_a_folder_that_is_not_there_is_an_error_that_says_so(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"nowhere.plan\.rrd: the recording cannot be written"):
        write_plan_recording(PLAN, tmp_path / "nowhere" / "plan.rrd")
