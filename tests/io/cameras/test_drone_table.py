"""The table of drone cameras that comes with the program."""

from importlib.resources import files

import numpy as np

from uavgram.io.cameras.choice import read_drone_cameras


def test_every_camera_of_the_table_is_read() -> None:
    assert len(read_drone_cameras()) == 106


def test_the_pixels_of_every_camera_are_of_a_size_that_sensors_have() -> None:
    pitch_mm = np.array([camera.pitch_mm for camera in read_drone_cameras()])

    assert (pitch_mm > 0.0005).all()
    assert (pitch_mm < 0.05).all()


def test_a_camera_is_what_the_table_says() -> None:
    mavic = next(c for c in read_drone_cameras() if c.make_model == "djiFC220")

    assert (mavic.width_px, mavic.height_px, mavic.is_thermal) == (4000, 3000, False)
    assert mavic.pitch_mm == (6.32692 / 4000, 4.7452 / 3000)
    # in OpenCV's order k1 k2 p1 p2 k3
    np.testing.assert_array_equal(
        mavic.distortion, [0.032984, -0.0855974, 0.000409773, -0.000806846, 0.0777778]
    )


def test_the_table_comes_with_its_licence() -> None:
    folder = files("uavgram.io.cameras").joinpath("drone_cameras")

    assert "Apache License" in folder.joinpath("LICENSE").read_text("utf-8")
    assert "Theta Informatics" in folder.joinpath("README.md").read_text("utf-8")
