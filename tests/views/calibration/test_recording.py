"""The recording of a calibration, read back from its file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration_accounts import make_account, make_previews
from PIL import Image
from rerun.chunk import Chunk, RrdReader

from uavgram.errors import OutputError
from uavgram.model.board import CalibrationAccount, CalibrationOptions
from uavgram.views.calibration.drawings import residual_factor
from uavgram.views.calibration.recording import write_calibration_recording

PHOTO = "/around_the_board/current_camera/photo"


@pytest.fixture(scope="module")
def account() -> CalibrationAccount:
    return make_account(spoil=3, photos=8, options=CalibrationOptions(outliers="remove"))


@pytest.fixture(scope="module")
def chunks(
    account: CalibrationAccount, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, list[Chunk]]:
    path = tmp_path_factory.mktemp("recording") / "calibration.rrd"
    write_calibration_recording(account, make_previews(account), path)
    found: dict[str, list[Chunk]] = {}
    reader = RrdReader(str(path))
    assert len(reader.blueprints()) == 1
    for chunk in reader.stream().to_chunks():
        found.setdefault(chunk.entity_path, []).append(chunk)
    return found


def column(chunks: dict[str, list[Chunk]], path: str, name: str) -> list[Any]:
    """Rows of a component, by frame where it moves; None where a chunk has it not."""
    rows = []
    for chunk in chunks[path]:
        batch = chunk.to_record_batch()
        for field in batch.schema.names:
            if field.endswith(name):
                rows += batch.column(field).to_pylist()
    return rows


def test_all_that_is_promised_is_there(chunks: dict[str, list[Chunk]]) -> None:
    assert {
        "/around_the_board/board", "/around_the_board/cameras", "/around_the_board/current_camera",
        "/before_the_camera/boards", "/before_the_camera/this_board", PHOTO, f"{PHOTO}/picture",
        f"{PHOTO}/corners", f"{PHOTO}/corners_odd", f"{PHOTO}/residual_exaggerated",
        "/maps/coverage", "/maps/residuals", "/maps/uncertainty", "/plots/residual/adjusted",
        "/plots/residual/left_out", "/plots/tilt/tilt", "/photo_status", "/documents/summary",
        "/documents/camera", "/documents/photo",
    } <= set(chunks)  # fmt: skip


def test_corners_lie_half_a_pixel_on_and_residuals_are_exaggerated_as_stated(
    chunks: dict[str, list[Chunk]], account: CalibrationAccount
) -> None:
    corners = account.result.corners
    used = np.array([status == "used" for status in corners.status])
    places = column(chunks, f"{PHOTO}/corners", "positions")
    strips = column(chunks, f"{PHOTO}/residual_exaggerated", "strips")
    factor = residual_factor(account.result)
    assert len(places) == len(strips) == 8
    for k in range(8):
        rows = used & (corners.photo == k)
        np.testing.assert_allclose(places[k], corners.pixel_px[rows] + 0.5, atol=1e-3)
        along = np.diff(np.array(strips[k]), axis=1)[:, 0]
        np.testing.assert_allclose(along, factor * corners.residual_px[rows], atol=1e-3)


def test_boards_before_the_camera_project_into_the_photo(
    chunks: dict[str, list[Chunk]], account: CalibrationAccount
) -> None:
    camera = account.result.calibration
    boards = np.array(column(chunks, "/before_the_camera/this_board", "strips"))[:, 0]
    assert boards.shape == (8, 5, 3)
    assert (boards[..., 2] > 0).all()
    pixel = boards[..., :2] / boards[..., 2:] * camera.parameters[:2] + camera.parameters[2:4]
    for k in range(8):  # the rim lies one square around the corners
        found = account.result.corners.pixel_px[account.result.corners.photo == k]
        rough = 60  # distortion, which a frame in space leaves out
        assert (pixel[k].min(axis=0) < found.min(axis=0) + rough).all()
        assert (pixel[k].max(axis=0) > found.max(axis=0) - rough).all()


def test_maps_are_those_of_the_report_in_the_shape_of_the_photos(
    chunks: dict[str, list[Chunk]], account: CalibrationAccount
) -> None:
    camera = account.result.calibration
    for path in ("/maps/coverage", "/maps/residuals", "/maps/uncertainty"):
        (blob,) = column(chunks, path, "blob")[0]
        with Image.open(io.BytesIO(np.array(blob, np.uint8).tobytes())) as picture:
            width, height = picture.size
        assert width / height == pytest.approx(camera.width_px / camera.height_px, rel=1e-2)
        assert width > 1000


def test_pages_name_every_parameter_and_every_photo(
    chunks: dict[str, list[Chunk]], account: CalibrationAccount
) -> None:
    summary = column(chunks, "/documents/summary", "text")[0][0]
    for name, value in zip(
        account.result.calibration.parameter_names, account.result.calibration.parameters,
        strict=True,
    ):  # fmt: skip
        assert (
            f"| {name} | **{value:.3f} px**" in summary or f"| {name} | **{value:.6f}**" in summary
        )
    assert "wall.jpg" in summary
    sheets = [page[0] for page in column(chunks, "/documents/photo", "text")]
    assert [f"# photo{k:02d}.jpg" for k in range(8)] == [page.split("\n")[0] for page in sheets]
    assert "Corners that do not fit" in sheets[1]


def test_a_folder_that_is_not_there_is_an_output_error(
    account: CalibrationAccount, tmp_path: Path
) -> None:
    with pytest.raises(OutputError, match="recording cannot be written"):
        write_calibration_recording(account, make_previews(account), tmp_path / "no" / "c.rrd")
