"""calibration.html: everything is said, nothing is loaded from elsewhere."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from calibration_accounts import make_account, make_previews

from uavgram.model.board import CalibrationAccount, CalibrationOptions
from uavgram.views.calibration import drawings as calibration_maps
from uavgram.views.calibration.drawings import tilt_directions, uncertainty_shares
from uavgram.views.calibration.report import calibration_lines, render_calibration_report
from uavgram.views.calibration.verdict import judge_calibration


@pytest.fixture(scope="module")
def account() -> CalibrationAccount:
    return make_account(
        name='<b>"mine"</b>', spoil=3, options=CalibrationOptions(coefficients=0, outliers="remove")
    )


def page(account: CalibrationAccount) -> str:
    pictures = {name: preview.jpeg for name, preview in make_previews(account).items()}
    return render_calibration_report(account, pictures)


@pytest.fixture(scope="module")
def html(account: CalibrationAccount) -> str:
    return page(account)


def test_nothing_is_loaded_from_elsewhere_and_names_are_escaped(html: str) -> None:
    assert not re.findall(r'(?:src|href)="(?!data:)', html)
    assert "http" not in html
    assert '<b>"mine"</b>' not in html
    assert "&lt;b&gt;" in html


def test_every_parameter_stands_with_its_sigma_and_correlations(
    html: str, account: CalibrationAccount
) -> None:
    camera = account.result.calibration
    sigma = np.sqrt(np.diag(camera.covariance))
    for value, error in zip(camera.parameters[:4], sigma[:4], strict=True):
        assert f"{value:.3f} px" in html
        assert f"{error:.3f} px" in html
    assert f"{account.result.calibration.correlation[0, 1]:+.2f}" in html


def test_every_photo_message_and_sum_is_there(html: str, account: CalibrationAccount) -> None:
    for file in (*account.result.photos.file, "wall.jpg"):
        assert f">{file}</td>" in html
    for one in account.provenance.inputs:
        assert one.sha256 in html
    for message in account.messages:
        assert message.text.split("'")[0].split("&")[0][:60] in html
        assert f">{message.code}<" in html
    assert html.count('src="data:image/jpeg') == len(account.result.photos.file) + 1
    for model in account.result.models:
        held = model.held_out_px
        assert ("cannot do without" if held is None else f"{held:.3f} px") in html


def test_removed_corners_are_listed_worst_first(html: str, account: CalibrationAccount) -> None:
    section = html[html.index("Corners that do not fit") : html.index("<h2>Method")]
    rows = re.findall(r'<td>(photo\d+\.jpg)</td><td class="n">(\d+)</td>', section)
    corners, files = account.result.corners, account.result.photos.file
    odd = [i for i, status in enumerate(corners.status) if status == "removed"]
    odd.sort(key=lambda i: -corners.w[i])
    assert len(odd) >= 3
    assert rows == [(files[corners.photo[i]], str(corners.corner[i])) for i in odd]


def test_coverage_counts_and_the_residuals_scale_are_stated(account: CalibrationAccount) -> None:
    result = account.result
    view = calibration_maps.coverage_map(result)
    written = [int(one.text) for one in view.drawing.written]
    assert written == result.maps.corners.ravel().tolist()
    empty = [fill == calibration_maps.EMPTY for fill in fills(view)]
    assert empty == (result.maps.corners.ravel() == 0).tolist()
    residuals = calibration_maps.residual_map(result)
    drawn = re.search(r"Drawn (\d+) times", residuals.note)
    assert drawn is not None
    factor = int(drawn.group(1))
    removed = np.array([status == "removed" for status in result.corners.status])
    first = np.flatnonzero(~removed)[0]
    start = (result.corners.pixel_px[first] + 0.5) * 520 / 1024
    end = start + factor * result.corners.residual_px[first] * 520 / 1024
    np.testing.assert_allclose(residuals.drawing.find_shapes("corners")[0], [start, end])


def fills(view: calibration_maps.Figure) -> list[str]:
    """The colours of the cells."""
    return [one.look.fill for one in view.drawing.shapes if one.name == "cells"]


def test_dark_cells_are_uncertain_ones(account: CalibrationAccount) -> None:
    share, low, high = uncertainty_shares(np.array([0.1, 0.4, np.nan, 1.6]))
    np.testing.assert_allclose(share, [0, 0.5, 1, 1])
    assert (low, high) == (0.1, 1.6)
    view = calibration_maps.uncertainty_map(account.result)
    values = account.result.maps.uncertainty_px.ravel()
    light = [sum(int(fill[k : k + 2], 16) for k in (1, 3, 5)) for fill in fills(view)]
    assert light[int(np.nanargmin(values))] > light[int(np.nanargmax(values))]


def test_the_dial_points_where_the_board_goes_away(account: CalibrationAccount) -> None:
    result = account.result
    tilt = tilt_directions(result)
    np.testing.assert_allclose(np.linalg.norm(tilt, axis=1), result.photos.tilt_deg)
    poses, corner = result.photos.poses, result.board.corner_board_m
    seen = np.einsum(
        "mji,mnj->mni", poses.world_from_camera, corner - poses.center_world_m[:, None]
    )
    for points, way in zip(seen, tilt, strict=True):
        along = (points[:, :2] - points[:, :2].mean(axis=0)) @ way
        assert np.corrcoef(along, points[:, 2])[0, 1] > 0.9


def test_a_fisheye_a_folding_lens_and_poses_without_ground_are_drawn() -> None:
    account = make_account(3, model="fisheye", photos=8)
    maps = account.result.maps
    unknown = maps.uncertainty_px.copy()
    unknown[0, 0] = np.nan
    result = replace(account.result, maps=replace(maps, uncertainty_px=unknown))
    effects = (account.effects[0], replace(account.effects[1], lengths=None))
    html = page(replace(account, result=result, effects=effects))
    assert "(no ground is seen)" in html
    assert "fisheye" in html
    assert "nan" not in html.replace("Kannala", "")


def test_the_verdict_goes_from_good_to_not_usable(account: CalibrationAccount) -> None:
    quiet = replace(account, messages=(), without_board=())
    good = judge_calibration(quiet)
    assert (good.level, good.reasons) == ("good", ())
    assert good.sentence.startswith("Good: the focal length is known to 0.")
    assert judge_calibration(account).sentence.startswith("Usable where the board was seen")
    camera = account.result.calibration
    wide = replace(
        quiet,
        result=replace(
            account.result, calibration=replace(camera, covariance=100**2 * camera.covariance)
        ),
    )
    assert judge_calibration(wide).sentence.startswith("Use with care")
    quality = replace(account.result.quality, converged=False)
    lost = replace(quiet, result=replace(account.result, quality=quality))
    assert judge_calibration(lost).sentence.startswith("Not usable")
    used = sum(status != "removed" for status in account.result.corners.status)
    assert f"12 of 13 photos and {used} of {len(account.result.corners.status)} corners" in (
        judge_calibration(account).counts
    )


def test_the_verdict_follows_what_the_lens_alone_costs_a_length(
    account: CalibrationAccount,
) -> None:
    quiet = replace(account, messages=(), without_board=())

    def sentence(fitted: float) -> str:
        lengths = account.effects[0].lengths
        assert lengths is not None
        worse = replace(lengths, pose_fitted=np.full(len(lengths.length), fitted))
        effects = (replace(account.effects[0], lengths=worse), *account.effects[1:])
        return judge_calibration(replace(quiet, effects=effects)).sentence

    assert sentence(0.001).startswith("Good: ")
    assert sentence(0.01) == "Use with care: the lens alone costs a length 1 %."
    assert sentence(9.02) == "Not usable: the lens alone costs a length 902 %."
    blind = (replace(account.effects[0], lengths=None), *account.effects[1:])
    verdict = judge_calibration(replace(quiet, effects=blind))
    assert verdict.sentence.startswith("Not usable: the lens model gives hardly any pixel")
    assert "estimate fewer coefficients" in verdict.reasons[0]


def test_the_terminal_shows_the_photos_that_fit_worst(account: CalibrationAccount) -> None:
    lines = calibration_lines(account)
    start = next(k for k, line in enumerate(lines) if line.startswith("photo "))
    files = [line.split()[0] for line in lines[start + 2 : start + 10]]
    order = np.argsort(-account.result.photos.rms_px)
    assert files == [account.result.photos.file[k] for k in order[:8]]
    assert lines[start + 10] == "and 4 photos that fit better"
