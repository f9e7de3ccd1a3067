"""Photos whose gimbal angles were not filled in: `mount` is asked for only where it is missing."""

from __future__ import annotations

from pathlib import Path

import pytest
from tagged_jpeg import dji, jpeg

from uavgram.pipeline.measure.inputs import read_inputs

TAGS = {
    "GpsLatitude": "46.5",
    "GpsLongitude": "8.1",
    "AbsoluteAltitude": "+500.0",
    **{f"Gimbal{angle}Degree": "+0.00" for angle in ("Yaw", "Pitch", "Roll")},
}


@pytest.mark.parametrize(("mount", "asks"), [("", True), ("mount: {pitch_deg: -60.0}\n", False)])
def test_mount_is_asked_for_where_the_project_does_not_state_it(
    tmp_path: Path, mount: str, *, asks: bool
) -> None:
    (tmp_path / "1.jpg").write_bytes(jpeg(dji(**TAGS)))
    (tmp_path / "camera.yaml").write_text(
        "name: c\nmodel: brown\nwidth_px: 16\nheight_px: 16\n"
        "parameters: [20, 20, 7.5, 7.5, 0, 0, 0, 0, 0]\n"
        "sigma: [1, 1, 1, 1, 0.0001, 0.0001, 0.00001, 0.00001, 0.0001]\n"
    )
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\n1.jpg,A,4,5\n")
    (tmp_path / "project.yaml").write_text(
        f"name: c\nimages: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\nposes: exif\n{mount}"
    )

    messages = read_inputs(tmp_path / "project.yaml").messages

    (text,) = [one.text for one in messages if one.code == "gimbal-not-filled"]
    assert ("State `mount`" in text) == asks
