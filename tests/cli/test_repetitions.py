"""A photo or a reading that is there twice changes no sigma, and is named."""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from csv_rows import read_rows, write_rows
from small_projects import Command, Project

import uavgram
from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import read_pixels
from uavgram.io.photos.metadata import APP1, build_jpeg, parse_jpeg
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import pose_frames


@pytest.fixture(scope="module")
def alone(small_survey: Path) -> Result:
    return uavgram.run(small_survey / "project.yaml", output=None)


def same(result: Result, before: Result) -> None:
    np.testing.assert_allclose(result.measurements.sigma, before.measurements.sigma, rtol=1e-9)
    np.testing.assert_allclose(result.measurements.value, before.measurements.value, rtol=1e-9)


def test_the_same_length_ten_times(project: Project, alone: Result) -> None:
    header, first, *rest = (project / "lines.csv").read_text().splitlines()
    name, start, end, *cells = first.split(",")
    copies = [",".join((f"{name}-{k}", end, start, *cells)) for k in range(9)]
    text = "\n".join([header, first, *rest, *copies]) + "\n"
    (project / "lines.csv").write_text(text)
    result = uavgram.run(project.path, output=None)
    same(result, alone)
    (said,) = [m.text for m in result.messages if m.code == "line-duplicate"]
    assert f"(counted: {name!r}; not counted: '{name}-0', '{name}-1'" in said
    status = dict(zip(result.lines.name, result.lines.status, strict=True))
    assert {status[f"{name}-{k}"] for k in range(9)} == {"removed"}
    assert result.checks_overall == alone.checks_overall


def test_a_copied_photo_with_the_picks_of_its_original(
    project: Project, alone: Result, command: Command
) -> None:
    rows = (project / "picks.csv").read_text().splitlines()
    photo = rows[1].split(",")[0]
    copy = "zz_copy.jpg"
    shutil.copy(project / "photos" / photo, project / "photos" / copy)
    again = [row.replace(photo, copy) for row in rows if row.startswith(photo)]
    (project / "picks.csv").write_text("\n".join([*rows, *again]) + "\n")
    result = uavgram.run(project.path, output=None)
    (said,) = [m.text for m in result.messages if m.code == "photo-duplicate"]
    assert f"{copy} is the same file as {photo}. " in said
    at = result.frames.frame_id.index(copy)
    assert result.frames.status[at] == "rejected"
    assert result.frames.reason[at] == f"the same photo as {photo}, which is counted"
    assert (result.measurements.sigma >= 0.98 * alone.measurements.sigma).all()
    assert f"{copy} is the same file as {photo}" in command("check", project.path).stdout


def picked_in_a_copy(project: Project, of: int, picked_as: int) -> tuple[str, str]:
    """Copy a photo, and click in the copy on the places of a photo's picks, with own errors."""
    rows = read_rows(project / "picks.csv")
    names = sorted({row["image"] for row in rows})
    copy = "zz_copy.jpg"
    shutil.copy(project / "photos" / names[of], project / "photos" / copy)
    draw = np.random.default_rng(3)
    for row in [row for row in rows if row["image"] == names[picked_as]]:
        place = {key: f"{float(row[key]) + draw.normal(0, 0.7):.3f}" for key in ("u_px", "v_px")}
        rows.append(row | place | {"image": copy})
    write_rows((project / "picks.csv"), rows)
    return names[of], copy


def test_clicks_in_a_copied_file_are_repeats(project: Project, alone: Result) -> None:
    picked_in_a_copy(project, 1, 1)
    result = uavgram.run(project.path, output=None)
    assert result.verdict.level == alone.verdict.level
    assert "copies-contradict" not in {message.code for message in result.messages}
    assert (result.measurements.sigma <= 1.02 * alone.measurements.sigma).all()
    off = (result.measurements.value - alone.measurements.value) / alone.measurements.sigma
    assert np.abs(off).max() < 2.0


def test_picks_of_another_photo_in_a_copied_file_bend_nothing(project: Project) -> None:
    """As without picks in that photo; both files and the labels are named."""
    photo, copy = picked_in_a_copy(project, 1, 2)
    result = uavgram.run(project.path, output=None)
    (said,) = [m for m in result.messages if m.code == "copies-contradict"]
    assert said.frames == (photo, copy)
    assert "'R2', 'R6', 'P1'" in said.text
    assert any(said.text.startswith(reason.text) for reason in result.verdict.reasons)
    rows = (project / "picks.csv").read_text().splitlines()
    kept = [row for row in rows if not row.startswith((photo, copy))]
    (project / "picks.csv").write_text("\n".join(kept) + "\n")
    without = uavgram.run(project.path, output=None)
    same(result, without)
    codes = [{message.code for message in one.messages} for one in (result, without)]
    assert codes[0] - codes[1] == {"copies-contradict"}


def saved_anew(project: Project, photo: str, copy: str, *, exif: bool) -> None:
    """The same exposure in another file: compressed again, with the tags or without."""
    encoded = (project / "photos" / photo).read_bytes()
    pixels = read_pixels(project / "photos" / photo)
    again = parse_jpeg(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes())
    before = parse_jpeg(encoded)
    assert again is not None
    assert before is not None
    tags = [one for one in before.segments if exif and one.marker == APP1]
    (project / "photos" / copy).write_bytes(build_jpeg([*tags, *again.segments], again.scan))


@pytest.mark.parametrize("exif", [True, False])
def test_clicks_in_a_photo_saved_anew_are_repeats_in_the_one_that_is_counted(
    project: Project, command: Command, *, exif: bool
) -> None:
    """The mean of two clicks is one click at their mean, as exact as two."""
    project.set(solve={"noise": "stated"})
    header, *rows = (project / "picks.csv").read_text().splitlines()
    photo = rows[0].split(",")[0]
    copy = f"{photo[:-4]}_small.jpg"
    own = [row.split(",") for row in rows if row.startswith(photo)]
    others = [row for row in rows if not row.startswith(photo)]
    assert header.startswith("image,label,u_px,v_px,sigma_px")

    def run(*picks: list[str]) -> Result:
        (project / "picks.csv").write_text("\n".join([header, *others, *map(",".join, picks)]))
        return uavgram.run(project.path, output=None)

    mean = run(
        *(
            [photo, label, str(float(u) + 0.25), v, str(float(sigma) / np.sqrt(2)), *rest]
            for _, label, u, v, sigma, *rest in own
        )
    )
    again = ([copy, label, str(float(u) + 0.5), v, *rest] for _, label, u, v, *rest in own)
    saved_anew(project, photo, copy, exif=exif)
    twice = run(*own, *again)

    np.testing.assert_allclose(twice.measurements.value, mean.measurements.value, rtol=1e-6)
    np.testing.assert_allclose(twice.measurements.sigma, mean.measurements.sigma, rtol=1e-6)
    at = twice.frames.frame_id.index(copy)
    assert twice.frames.status[at] == "rejected"
    assert twice.frames.reason[at] == f"the same photo as {photo}, which is counted"
    assert any(m.code == "photo-saved-anew" and m.frames == (copy,) for m in twice.messages)
    told = command("check", project.path).stdout
    assert f"{copy} is the same exposure as {photo}" in told
    assert "frame-unmatched" not in told


@pytest.mark.parametrize("exif", [True, False])
def test_a_copy_without_picks_takes_no_event_from_a_photo(project: Project, *, exif: bool) -> None:
    """The log has one event more than there are photos: the copy would make them equally many."""
    copy, before = "IMG_0001_small.jpg", pose_frames(read_inputs(project.path)).frames
    saved_anew(project, "IMG_0001.jpg", copy, exif=exif)
    posed = pose_frames(read_inputs(project.path))
    frames, pairing = posed.frames, posed.pairing

    kept = [k for k, name in enumerate(frames.frame_id) if name != copy]
    assert frames.clock_offset_s == pytest.approx(before.clock_offset_s, abs=1e-9)
    assert tuple(frames.frame_id[k] for k in kept) == before.frame_id
    assert frames.matched[kept].all()
    assert frames.matched.sum() == len(kept)
    assert pairing is not None
    assert pairing.frame_id == frames.frame_id

    project.set(time={"source": "events"})
    with pytest.raises(InputError, match="there are 13 photos and 14 confirmed camera events"):
        pose_frames(read_inputs(project.path))


# A run that has the same to say of many frames, or of many measurements, says it once.


FULL_FRAMES = 6


def test_many_frames_and_many_measurements_are_one_message_each(project: Project) -> None:
    rows = read_rows(project / "picks.csv")
    names = sorted({row["image"] for row in rows})
    poor = names[FULL_FRAMES:]  # without a log, a single pick places no frame
    first = {row["image"]: row for row in reversed(rows)}
    kept = [row for row in rows if row["image"] not in poor] + [first[name] for name in poor]
    for row in kept:
        row["sigma_px"] = "20"
    write_rows((project / "picks.csv"), kept)
    requests = [f"place of P{k},coordinate,P{k}," for k in range(1, 14)]
    (project / "measure.csv").write_text("name,kind,points,parameters\n" + "\n".join(requests))
    project.set(log=None, time=None, mount=None)

    result = uavgram.run(project.path, output=None)

    (left_out,) = [m for m in result.messages if m.code == "frame-left-out"]
    assert left_out.text.startswith(f"{len(poor)} photos were left out, with all of their picks: ")
    assert left_out.frames == tuple(poor)
    (doubtful,) = [m for m in result.messages if m.code == "first-order-doubtful"]
    number = len(doubtful.measurements)
    assert number >= 13
    assert doubtful.text.startswith(f"The ± of {number} measurements are approximate, as the ")
    assert doubtful.text.endswith("Tape more lengths.")


def test_a_copy_whose_name_holds_no_time_is_counted_once(project: Project, alone: Result) -> None:
    photos = read_inputs(project.path).photos
    moments = (datetime.fromtimestamp(time_s, UTC) for time_s in photos.file_time_s)
    named = {
        name: f"{moment:%Y%m%d_%H%M%S_%f}.jpg"
        for name, moment in zip(photos.frame_id, moments, strict=True)
    }
    picks = (project / "picks.csv").read_text()
    for name, timed in named.items():
        (project / "photos" / name).rename(project / "photos" / timed)
        picks = picks.replace(name, timed)
    first = picks.splitlines()[1].split(",")[0]
    copy = "zz from the phone.jpg"
    saved_anew(project, first, copy, exif=False)
    again = [row.replace(first, copy) for row in picks.splitlines() if row.startswith(first)]
    (project / "picks.csv").write_text("\n".join([picks.rstrip(), *again]) + "\n")
    project.set(time={"source": "filename", "filename_format": "%Y%m%d_%H%M%S_%f"})

    result = uavgram.run(project.path, output=None)

    assert result.frames.reason[result.frames.frame_id.index(copy)] == (
        f"the same photo as {first}, which is counted"
    )
    assert (result.measurements.sigma >= 0.98 * alone.measurements.sigma).all()
