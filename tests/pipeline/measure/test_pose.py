"""Where nobody states how the camera hung, what rests on it is not checked; no tape is blamed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from csv_rows import read_rows
from hostile_conditions import CLEAN, CONDITIONS
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.views.survey.verdict import verdict_sentence

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
    for row in read_rows(street / "picks.csv"):
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
    assert "did not look straight down" in result.verdict.reasons[0].plain


def test_with_its_direction_stated_it_is_right_and_the_log_alone_is_unchecked(
    street: Path, tmp_path: Path
) -> None:
    """Without a length, nothing shows a gross error of the log's height."""
    stated = "mount: {gimbal: none, pitch_deg: -45.0}\n"
    result = result_of(street, tmp_path, mount=stated)
    first = result.verdict.reasons[0]

    assert abs(result.measurements.value[0] - TRUE_M) < 3.0 * result.measurements.sigma[0]
    assert result.measurements.status == ("not-checked",)
    assert "the position of 'IMG_0030.jpg' by the log (up)" in first.text
    assert "the camera's direction" not in first.text


def test_a_right_tape_is_not_blamed_alone(street: Path, tmp_path: Path) -> None:
    first = result_of(street, tmp_path, lengths=("L4",)).verdict.reasons[0]

    assert first.cause == "blunder-not-located"
    assert first.lengths == ("L4",)
    assert "the camera's direction" in first.text


def test_several_photos_show_it_and_a_length_with_little_redundancy_is_named(
    street: Path, tmp_path: Path
) -> None:
    photos = ("IMG_0029.jpg", "IMG_0030.jpg", "IMG_0031.jpg")
    lengths = tuple(f"L{k}" for k in range(1, 7))
    result = result_of(street, tmp_path, photos=photos, clicks=1, lengths=lengths)

    assert result.verdict.reasons[0].cause == "mount-turned"
    assert result.verdict.reasons[0].text.startswith("The camera did not look straight down")
    assert "all photos turned by +45 degrees up or down (pitch)" in result.verdict.reasons[0].text
    assert result.measurements.status == ("not-checked",)
    assert "an error in the length 'L4' ('R7' to 'R8') would not" in result.verdict.reasons[1].text
    assert abs(result.measurements.value[0] - TRUE_M) < 3.0 * result.measurements.sigma[0]


# A jump of the log's position in a whole run: said first, and the frames behind it freed.


@pytest.mark.parametrize("seed", [0, 1])
def test_a_gps_jump_is_said_first_and_no_clock_is_blamed(tmp_path: Path, seed: int) -> None:
    survey = make_survey(CONDITIONS["gps_jump_10m"], seed)
    result = compute(read_inputs(write_project(survey, tmp_path)), curved=False).result
    warnings = [m for m in result.messages if m.level == "warning"]
    assert warnings[0].text.startswith("The log's position jumps by 10.0 m between photo ")
    assert 3 <= len(warnings[0].frames) <= 6
    assert not any("clock drift" in m.text for m in result.messages)
    assert not any(m.code in ("telemetry-strained", "group-misfit") for m in warnings)
    assert "position jumps by 10.0 m" in verdict_sentence(result)
    rows = result.measurements
    for name, value, sigma in zip(rows.name, rows.value, rows.sigma, strict=True):
        assert abs(value - survey.truth[name]) < 4.5 * sigma


@pytest.mark.parametrize("condition", ["clean", "plane"])
def test_a_clean_survey_says_nothing_of_the_log(tmp_path: Path, condition: str) -> None:
    """Nor does that of an aircraft that turns hard, as its gyroscopes tell."""
    survey = make_survey(CONDITIONS[condition], 0)
    result = compute(read_inputs(write_project(survey, tmp_path)), curved=False).result
    codes = ("log-", "estimator-")
    assert not any(m.code.startswith(codes) for m in result.messages)


# A log that never says how the vehicle was turned: places from it, attitudes from ties.


def test_ties_turn_photos_of_a_log_that_has_only_positions(tmp_path: Path) -> None:
    survey = make_survey(replace(CLEAN, ties=80), 0)
    inputs = read_inputs(write_project(survey, tmp_path))
    assert inputs.log is not None
    boots = tuple(replace(boot, attitudes=None, gimbal=None) for boot in inputs.log.boots)
    result = compute(replace(inputs, log=replace(inputs.log, boots=boots)), curved=False).result

    assert result.solution.converged
    assert set(result.frames.status) == {"refined"}
    rows = result.measurements
    true = np.array([survey.truth[name] for name in rows.name])
    assert (np.abs(rows.value - true) < 4.5 * rows.sigma).all()
    assert (rows.sigma < 0.01 * true).all()
    assert "attitude-unknown" in {m.code for m in result.messages}
