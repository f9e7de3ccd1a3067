"""Altitudes of photos without RTK, tens of metres off, are shifted to the heights of control."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tagged_jpeg import dji, jpeg

from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import PosedFrames, pose_frames

ABOVE_TAKE_OFF_M, TAKE_OFF_M = 40.0, 523.6
CONTROL_M = {"A": 500.1, "B": 499.9, "C": 500.0, "not picked": 900.0}
TAGS = {
    "GpsLatitude": "46.5",
    "GpsLongitude": "8.1",
    "AbsoluteAltitude": f"{TAKE_OFF_M + ABOVE_TAKE_OFF_M:+.2f}",
    "RelativeAltitude": f"{ABOVE_TAKE_OFF_M:+.2f}",
    "GimbalYawDegree": "+10.00",
    "GimbalPitchDegree": "-90.00",
    "GimbalRollDegree": "+0.00",
}
RTK = {"AltitudeType": "RtkAlt", "RtkFlag": "50", "RtkStdLon": "0.01", "RtkStdLat": "0.01"}


def pose(folder: Path, project: str = "", **tags: str) -> PosedFrames:
    (folder / "1.jpg").write_bytes(jpeg(dji(**TAGS, **tags)))
    (folder / "camera.yaml").write_text(
        "name: c\nmodel: brown\nwidth_px: 16\nheight_px: 16\n"
        "parameters: [20, 20, 7.5, 7.5, 0, 0, 0, 0, 0]\n"
        "sigma: [1, 1, 1, 1, 0.0001, 0.0001, 0.00001, 0.00001, 0.0001]\n"
    )
    (folder / "picks.csv").write_text(
        "image,label,u_px,v_px\n1.jpg,A,4,5\n1.jpg,B,5,9\n1.jpg,C,9,5\n"
    )
    rows = [f"{name},46.5,8.1,{height},0.02" for name, height in CONTROL_M.items()]
    head = "label,latitude_deg,longitude_deg,height_m,sigma_m"
    (folder / "control.csv").write_text("\n".join([head, *rows, ""]))
    (folder / "project.yaml").write_text(
        "name: c\nimages: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\nposes: exif\n"
        f"control: control.csv\n{project}"
    )
    return pose_frames(read_inputs(folder / "project.yaml"))


@pytest.mark.parametrize("ground_m", [0.0, -2.5])
def test_ground_at_the_control_is_as_high_above_take_off_as_stated(
    tmp_path: Path, ground_m: float
) -> None:
    posed = pose(tmp_path, f"ground: {{height_m: {ground_m}}}\n")

    assert posed.world.origin is not None
    assert posed.world.origin.height_m == pytest.approx(500.0 - ground_m)
    assert posed.telemetry is not None
    center_m = posed.telemetry.poses.center_world_m
    np.testing.assert_allclose(center_m[0, 2], ABOVE_TAKE_OFF_M, atol=1e-6)
    (text,) = [one.text for one in posed.messages if one.code == "heights-by-control"]
    assert f"{500.0 - TAKE_OFF_M - ground_m:+.1f} m" in text


@pytest.mark.parametrize(
    ("project", "tags"),
    [
        ("world: {heights: ellipsoid}\n", {**RTK, "RtkStdHgt": "0.02"}),
        ("world: {origin: {latitude_deg: 46.5, longitude_deg: 8.1, height_m: 523.6}}\n", {}),
    ],
)
def test_heights_of_rtk_and_of_a_stated_origin_stay(
    tmp_path: Path, project: str, tags: dict[str, str]
) -> None:
    posed = pose(tmp_path, project, **tags)

    assert posed.world.origin is not None
    assert posed.world.origin.height_m == pytest.approx(TAKE_OFF_M)
    assert "heights-by-control" not in {one.code for one in posed.messages}
