"""Photos to be taken: where points appear, what drifts out of them, what they show."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from plan_scenes import camera
from scipy.spatial.transform import Rotation

from uavgram.model.arrays import Floats
from uavgram.synthetic.plan.cameras import PlannedCameras, compute_footprints, find_visible
from uavgram.synthetic.plan.scene import Deviation, PlanScene
from uavgram.synthetic.sight import EDGE_PX

AREA = np.array([[-20.0, -15], [20, -15], [20, 15], [-20, 15]])
LENS = np.array([2250.0, 2250, 1490, 1120, -0.05, 0.02, 2e-4, -1e-4, 0])
CAMERA = replace(camera(), parameters=LENS)
LOOKING = PlannedCameras(
    np.array([[0.0, -10, 40], [5, 2, 35]]),
    np.array([0.0, 130]),
    np.array([-70.0, -88]),
    np.arange(2.0),
)


def by_opencv(
    cameras: PlannedCameras, frame: int, point: Floats, turn: Floats | None = None
) -> Floats:
    """Pixels by OpenCV: the camera looks north and down, then is turned about up."""
    pitch, heading = np.deg2rad([cameras.pitch_deg[frame], cameras.heading_deg[frame]])
    forward = np.array([0, np.cos(pitch), np.sin(pitch)])
    right = np.array([1.0, 0, 0])
    axes = Rotation.from_euler("z", -heading).as_matrix() @ np.column_stack(
        [right, np.cross(forward, right), forward]
    )
    if turn is not None:
        axes = axes @ Rotation.from_rotvec(turn).as_matrix()
    matrix = np.array([[LENS[0], 0, LENS[2]], [0, LENS[1], LENS[3]], [0, 0, 1]])
    in_camera = (point - cameras.center_m[frame]) @ axes
    pixel, _ = cv2.projectPoints(in_camera, np.zeros(3), np.zeros(3), matrix, LENS[4:])
    return np.asarray(pixel[:, 0], np.float64)


def test_pixels_are_those_of_opencv() -> None:
    point = np.random.default_rng(0).uniform([-15, -12, -1], [15, 12, 1], (30, 3))
    found = find_visible(CAMERA, LOOKING, point, None)
    for frame in range(2):
        np.testing.assert_allclose(
            found.pixel_px[frame], by_opencv(LOOKING, frame, point), atol=1e-6
        )


def test_what_is_certain_stays_in_the_photo_in_95_of_100_flights() -> None:
    """At each edge; a point right at the limit leaves the photo in a twentieth of the flights."""
    rng = np.random.default_rng(1)
    deviation = Deviation(position_m=2.0, attitude_deg=1.8)
    row = np.column_stack([np.linspace(0, 40, 4001), np.zeros(4001), np.zeros(4001)])
    certain = find_visible(CAMERA, LOOKING, row, deviation).certain[0]
    edge = row[certain][[-1]]
    flown, out = 3000, 0
    for _ in range(flown):
        moved = LOOKING._replace(center_m=LOOKING.center_m + 2.0 * rng.standard_normal(3))
        pixel = by_opencv(moved, 0, edge, np.deg2rad(1.8) * rng.standard_normal(3))
        out += int(pixel[0, 0] > CAMERA.width_px - 1 - EDGE_PX)
    assert out / flown == pytest.approx(0.05, abs=0.02)


def test_footprints_end_where_photos_do() -> None:
    scene = PlanScene(calibration=CAMERA, area_m=AREA, slope=np.array([0.02, -0.03]))
    whole, certain = compute_footprints(scene, LOOKING)
    right, bottom = CAMERA.width_px - 1, CAMERA.height_px - 1
    for frame in range(2):
        np.testing.assert_allclose(
            whole[frame][:, 2], scene.on_ground(whole[frame][:, :2])[:, 2], atol=1e-9
        )
        pixel = by_opencv(LOOKING, frame, whole[frame])
        off = np.minimum(np.abs(pixel), np.abs(pixel - [right, bottom])).min(axis=1)
        assert off.max() < 1e-5
        for outline in (whole[frame], certain[frame]):
            x, y = outline[:, :2].T
            assert x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0  # counterclockwise from above
        inside = find_visible(CAMERA, LOOKING, certain[frame], None).certain[frame]
        assert inside.all()
