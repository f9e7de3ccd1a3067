"""Where nobody states how the camera hung, what rests on it is not checked; no tape is blamed."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

TAPED = tuple(f"R{k}" for k in range(1, 9))
TRUE_M = 19.68
"""From R1 to R4, by the street's truth."""


@pytest.fixture(scope="module")
def street(data_dir: Path) -> Path:
    folder = data_dir / "street_oblique"
    if not folder.is_dir():
        pytest.skip(f"no street_oblique in {data_dir}")
    return folder


def result_of(
    street: Path,
    folder: Path,
    *,
    photos: tuple[str, ...] = ("IMG_0030.jpg",),
    clicks: int = 2,
    lengths: tuple[str, ...] = (),
    mount: str = "",
) -> Result:
    """Measure from R1 to R4 in photos that look 45 degrees down, with a log without a gimbal."""
    picks = ["image,label,u_px,v_px"]
    with (street / "picks.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["image"] in photos and row["label"] in TAPED:
                u, v = float(row["u_px"]), float(row["v_px"])
                picks += [
                    f"{row['image']},{row['label']},{u + 0.4 * k:.2f},{v - 0.3 * k:.2f}"
                    for k in range(clicks)
                ]
    head, *lines = (street / "lines.csv").read_text(encoding="utf-8").splitlines()
    (folder / "picks.csv").write_text("\n".join(picks), encoding="utf-8")
    chosen = [head, *(line for line in lines if line.split(",")[0] in lengths)]
    (folder / "lines.csv").write_text("\n".join(chosen), encoding="utf-8")
    (folder / "measure.csv").write_text("name,kind,points\nD,distance,R1;R4\n", encoding="utf-8")
    (folder / "project.yaml").write_text(
        f"name: street\nimages: {street.as_posix()}/photos/*.jpg\n"
        f"log: {street.as_posix()}/flight.BIN\ncamera: {street.as_posix()}/camera.yaml\n"
        "picks: picks.csv\nlines: lines.csv\nmeasure: measure.csv\n"
        "time: {source: exif, offset_s: 0.0, offset_sigma_s: 0.05}\n"
        f"ground: {{height_sigma_m: 2.0}}\n{mount}",
        encoding="utf-8",
    )
    return compute(read_inputs(folder / "project.yaml"), curved=False).result


def test_one_photo_clicked_twice_does_not_check_how_the_camera_hung(
    street: Path, tmp_path: Path
) -> None:
    result = result_of(street, tmp_path)

    assert abs(result.measurements.value[0] - TRUE_M) > 5.0 * result.measurements.sigma[0]
    assert result.measurements.status == ("not-checked",)
    assert result.verdict.level == "amber"
    assert "`mount`" in result.verdict.reasons[0].text
    assert "the camera's direction" in result.verdict.reasons[0].plain


def test_with_its_direction_stated_it_is_right_and_checked(street: Path, tmp_path: Path) -> None:
    stated = "mount: {gimbal: none, pitch_deg: -45.0}\n"
    result = result_of(street, tmp_path, mount=stated)

    assert abs(result.measurements.value[0] - TRUE_M) < 3.0 * result.measurements.sigma[0]
    assert result.measurements.status == ("ok",)


def test_a_right_tape_is_not_blamed_alone(street: Path, tmp_path: Path) -> None:
    first = result_of(street, tmp_path, lengths=("L4",)).verdict.reasons[0]

    assert first.cause == "blunder-not-located"
    assert first.lengths == ("L4",)
    assert "the camera's direction" in first.text


def test_several_photos_show_it_and_their_values_are_checked(street: Path, tmp_path: Path) -> None:
    photos = ("IMG_0029.jpg", "IMG_0030.jpg", "IMG_0031.jpg")
    result = result_of(
        street, tmp_path, photos=photos, clicks=1, lengths=tuple(f"L{k}" for k in range(1, 7))
    )

    assert result.verdict.reasons[0].cause == "gimbal-off"
    assert result.measurements.status == ("ok",)
    assert abs(result.measurements.value[0] - TRUE_M) < 3.0 * result.measurements.sigma[0]
