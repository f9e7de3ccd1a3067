"""The annex: orientation, correlations, residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey as survey
from scipy.spatial.transform import Rotation

from uavgram.model.result.result import OrientationCorrelation
from uavgram.views.report import render_annex
from uavgram.views.report.page import lay_out_annex, omega_phi_kappa_deg


def test_omega_phi_kappa_are_those_of_scipy() -> None:
    angles = np.array([12.0, -7.0, 130.0])
    turn = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()  # intrinsic: Rx Ry Rz

    np.testing.assert_allclose(omega_phi_kappa_deg(turn @ np.diag([1.0, -1.0, -1.0])), angles)


def test_each_adjusted_photo_has_its_pose_its_correlations_and_its_residuals() -> None:
    made = survey.build()
    told = lay_out_annex(made)
    shown = zip(told.poses.rows, told.correlations, told.residuals.rows, strict=True)
    for pose, (name, correlations), row in shown:
        frame = made.frames.frame_id.index(name)
        assert pose[0].text == row[0].text == name
        covariance = made.frames.refined.covariance[frame]
        sigma = np.sqrt(np.diag(covariance))
        correlation = (covariance / np.outer(sigma, sigma))[np.triu_indices(6, 1)]
        np.testing.assert_allclose(np.array(correlations, float), correlation, atol=0.00501)
        turned = [float(cell.text) for cell in pose[-3:]]
        np.testing.assert_allclose(turned, np.degrees(sigma[3:]), atol=0.000501)
        used = [
            made.picks.residual_px[i]
            for i, image in enumerate(made.picks.image)
            if image == name and made.picks.status[i] in ("used", "suspect")
        ]
        wanted = np.sqrt(np.mean(np.square(used), axis=0)) if used else []
        assert row[1].text == str(len(used))
        np.testing.assert_allclose(
            [float(x.text) for x in row[2:4] if x.text != "–"], wanted, atol=0.00501
        )

    assert len(told.poses.rows) == int(made.has_refined.sum())


def test_correlations_with_the_camera_stand_by_photo_and_a_dash_where_something_is_known() -> None:
    made = survey.build()
    name = made.frames.frame_id[int(np.flatnonzero(made.has_refined)[0])]
    known = OrientationCorrelation(
        parameters=("fx", "plane height"),
        shared=np.array([[1.0, np.nan], [np.nan, np.nan]]),
        frame_id=(name,),
        with_pose=np.array([[[0.123, np.nan], *[[0.0, 0.5]] * 5]]),
    )
    told = lay_out_annex(replace(made, orientation=known))

    assert told.shared is not None
    assert told.shared.rows == (("fx", ("1.00", "–")), ("plane height", ("–", "–")))
    assert (told.matrices[0].title, told.matrices[0].rows[0]) == (name, ("east", ("0.12", "–")))
    assert lay_out_annex(made).shared is None
    assert "turn about forward" in render_annex(replace(made, orientation=known))
