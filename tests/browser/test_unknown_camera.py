"""From photos and nothing else to a calibrated camera: `uavgram new`, then the Camera tab."""

from __future__ import annotations

import shutil
from pathlib import Path

from opened_pages import PageOpener
from pick_pages import small_project
from picking_server import served
from playwright.sync_api import expect

from uavgram.cli import main
from uavgram.config.project import load_project


def test_a_camera_that_nobody_knows_is_said_to_be_and_calibrated_on_the_page(
    tmp_path: Path, open_page: PageOpener, data_dir: Path
) -> None:
    flight = tmp_path / "flight"
    small_project(flight).unlink()
    (flight / "camera.yaml").unlink()
    project = flight / "project.yaml"
    assert main(["new", str(flight)]) == 0
    assert load_project(project).camera == "unknown"
    board = tmp_path / "board"  # beside the flight
    board.mkdir()
    for k in range(1, 7):
        shutil.copy(data_dir / "opencv_chess" / f"left{k:02}.jpg", board)
    with served(project) as server:
        page = open_page(server)
        page.get_by_role("tab", name="Camera").click()
        panel = page.get_by_role("tabpanel", name="Camera")
        expect(panel).to_contain_text("Nothing is known of this camera")
        expect(panel).to_contain_text(
            "The camera is not known, so an ordinary drone camera is assumed"
        )
        form = panel.get_by_role("form", name="Calibration")
        form.get_by_label("Folder").select_option("../board: 6 photo files, 640 × 480 px")
        form.get_by_role("button", name="Start").click()
        panel.get_by_role("button", name="Use it").click()
        expect(panel).to_contain_text("calibrated from 6 photos of a board")
        expect(panel).not_to_contain_text("Nothing is known of this camera")
        assert not open_page.errors
    assert load_project(project).camera == str(flight / "calibration" / "camera.yaml")
