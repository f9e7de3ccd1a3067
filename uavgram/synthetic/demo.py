"""Built-in survey: simulated, rendered, written as files of a real one; run, or left unpicked."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.config.camera import camera_text
from uavgram.errors import InputError, OutputError
from uavgram.io.files import remove_link
from uavgram.io.json_codec import Record, encode, records
from uavgram.io.logs.tlog.writer import write_tlog
from uavgram.io.photos.tagging import insert_exif
from uavgram.io.tables.csv_tables import csv_text
from uavgram.io.tables.updates import (
    LINES_HEADER,
    MEASURE_HEADER,
    PICKS_HEADER,
    create_table,
    update_lines,
    update_measure,
    update_picks,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.inputs import NO_LINES, NO_PICKS
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.synthetic.accident_scene import SAMPLE_MARK, TAPE_FILE, is_sample
from uavgram.synthetic.rendering import render_photos
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import SimulatedSurvey, format_project, make_project, simulate

JPEG_QUALITY = 92
HEADERS = {"picks.csv": PICKS_HEADER, "lines.csv": LINES_HEADER, "measure.csv": MEASURE_HEADER}
MAKE = "uavgram"
_SHARED = (
    *("intrinsics", "boresight_rad", "lever_arm_m", "position_bias_m", "heading_bias_rad"),
    "clock_offset_s",
)


def write_demo(folder: Path, survey: SimulatedSurvey, photos: Iterable[NDArray[np.uint8]]) -> Path:
    """Write a simulated survey: photos, log, camera, picks, lengths, checks, project and truth.

    Parameters
    ----------
    folder
        Output folder; made if absent. Files of the same names are overwritten.
    survey
        Survey to write.
    photos
        (H, W, 3) BGR, one for each frame, in order; may be generated on demand.

    Returns
    -------
    Path of the project file, which is written last.

    Raises
    ------
    OutputError
        The folder cannot be written, or its photos/ holds photos of another survey.
    """
    try:
        _write_flight(folder, survey, photos)
        _write_observations(folder, survey)
        _write_known_points(folder, survey)
        truth = json.dumps(truth_as_json(survey), indent=1) + "\n"
        remove_link(folder / "truth.json").write_text(truth, encoding="utf-8")
        project = remove_link(folder / "project.yaml")
        project.write_text(format_project(make_project(survey.scenario)), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror}; name another") from error
    return project


def write_unpicked(
    folder: Path, survey: SimulatedSurvey, photos: Iterable[NDArray[np.uint8]], about: str
) -> Path:
    """Write the files of a flight: photos, log, camera and project, with empty tables.

    Parameters
    ----------
    folder, survey, photos
        As of `write_demo`.
    about
        First line of the project file, a comment.

    Returns
    -------
    Path of the project file, which is written last.

    Raises
    ------
    OutputError
        The folder's photos/ holds photos of another survey.
    OSError
        It cannot be written.
    """
    _write_flight(folder, survey, photos)
    _write_tables(folder, dict.fromkeys(HEADERS))
    project = remove_link(folder / "project.yaml")
    unchecked = replace(make_project(survey.scenario), check=None)
    project.write_text(format_project(unchecked, about), encoding="utf-8")
    return project


def truth_as_json(survey: SimulatedSurvey) -> Record:
    """Return the truth in metres, radians, seconds and pixels; world origin = the log's home."""
    truth, site = survey.truth, survey.scenario.site
    lost = np.flatnonzero(~survey.event_has_photo)
    lines = survey.lines
    frames = records(
        time_utc_s=truth.time_utc_s,
        center_world_m=truth.center_world_m,
        world_from_camera=truth.world_from_camera,
    )
    return {
        "seed": survey.scenario.seed,
        "world": {
            key: getattr(site, key) for key in ("latitude_deg", "longitude_deg", "height_msl_m")
        },
        "ground": {
            "height_m": truth.surface.height_m,
            "slope": encode(truth.surface.slope),
            "pivot_m": encode(truth.surface.middle_m),
        },
        **{key: encode(getattr(truth, key)) for key in _SHARED},
        "boot_to_utc_s": survey.log.boot_utc_s,
        "lost_exposures_utc_s": encode(survey.log.boot_utc_s + survey.log.event_time_s[lost]),
        "frames": dict(zip(truth.frame_id, frames, strict=True)),
        "points": dict(zip(truth.label, encode(truth.point_world_m), strict=True)),
        "lines": records(
            name=lines.name, **{"from": lines.start}, to=lines.end, length_m=truth.line_length_m
        ),
        "measurements": records(
            name=truth.measurement_name,
            value=truth.measurement_value,
            unit=truth.measurement_unit,
        ),
    }


def _write_flight(
    folder: Path, survey: SimulatedSurvey, photos: Iterable[NDArray[np.uint8]]
) -> None:
    """Write photos, log and camera."""
    _make_photo_folder(folder / "photos", survey.frame_id)
    _write_photos(folder / "photos", survey, photos)
    write_tlog(remove_link(folder / "flight.tlog"), survey.log)
    camera = camera_text(survey.calibration)
    remove_link(folder / "camera.yaml").write_text(camera, encoding="utf-8")


def _make_photo_folder(folder: Path, frame_id: Sequence[str]) -> None:
    remove_link(folder).mkdir(parents=True, exist_ok=True)
    strangers = sorted({p.name for p in folder.glob("*.jpg")} - set(frame_id))
    if strangers:
        raise OutputError(
            f"{folder}: holds photos of another survey ({strangers[0]}...), which the project "
            "would take for its own; name an empty folder"
        )


def _write_photos(
    folder: Path, survey: SimulatedSurvey, photos: Iterable[NDArray[np.uint8]]
) -> None:
    times = survey.file_time_utc_s.tolist()
    zone_h, camera = survey.scenario.errors.camera_zone_h, survey.calibration.name
    for name, time, photo in zip(survey.frame_id, times, photos, strict=True):
        done, jpeg = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not done:
            raise ValueError(f"{name}: an image of shape {photo.shape} cannot be encoded")
        tagged = insert_exif(
            jpeg.tobytes(), time_utc_s=time, zone_h=zone_h, make=MAKE, model=camera
        )
        remove_link(folder / name).write_bytes(tagged)


def _write_observations(folder: Path, survey: SimulatedSurvey) -> None:
    """Write picks.csv, lines.csv and measure.csv."""
    picks, lines = survey.picks, survey.lines
    picks = replace(
        picks,
        pixel_px=picks.pixel_px.round(3),
        sigma_px=picks.sigma_px.round(2),
        height_m=picks.height_m.round(4),
    )
    lines = replace(lines, length_m=lines.length_m.round(4), sigma_m=lines.sigma_m.round(4))
    tables = {
        "picks.csv": update_picks(None, NO_PICKS, picks),
        "lines.csv": update_lines(None, NO_LINES, lines),
        "measure.csv": update_measure(None, (), survey.measurements),
    }
    _write_tables(folder, tables)


def _write_tables(folder: Path, contents: Mapping[str, bytes | None]) -> None:
    """Write tables; those without content have only a header."""
    for name, content in contents.items():
        remove_link(folder / name).write_bytes(content or create_table(HEADERS[name], ()))


def _write_known_points(folder: Path, survey: SimulatedSurvey) -> None:
    """Write check.csv (and control.csv) with known coordinates."""
    for name, points in (("check.csv", survey.checks), ("control.csv", survey.control)):
        if len(points.label) or name == "check.csv":
            columns = _texts(np.column_stack([points.coordinates, points.sigma_m[:, 0]]), 4)
            header = ("label", "east_m", "north_m", "up_m", "sigma_m")
            _write_csv(folder / name, header, zip(points.label, *columns, strict=True))


def _write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    remove_link(path).write_text(csv_text(header, rows), encoding="utf-8", newline="")


def _texts(columns: Floats, digits: int) -> list[list[str]]:
    """Format the columns of (N, K) numbers as text."""
    return [[f"{value:.{digits}f}" for value in column] for column in columns.T.tolist()]


@limit_blas_threads
def run_demo(
    folder: Path,
    scenario: Scenario,
    progress: Progress = silent,
    calibration: Calibration | None = None,
) -> tuple[Result, Mapping[str, float], Path]:
    """Create a survey with known truth, and run it.

    Parameters
    ----------
    folder
        Folder of its files; made if absent.
    scenario
        The numbers that define it.
    progress
        Shows long loops.
    calibration
        Of its camera, where that comes from a file.

    Returns
    -------
    result : Result
    truth
        True values by the names of the measurements.
    project
        The project file.
    """
    survey = simulate(scenario, calibration)
    photos = progress(render_photos(survey), "rendering photos", len(survey.frame_id))
    project = write_demo(folder, survey, photos)
    result = run(project, progress=progress)
    names, values = survey.truth.measurement_name, survey.truth.measurement_value.tolist()
    return result, dict(zip(names, values, strict=True)), project


SAMPLE_NAME = "uavgram-sample"
"""Default name of the sample's folder."""


@limit_blas_threads
def make_sample(folder: Path, progress: Progress = silent) -> Path:
    """Create the sample in a folder; an existing sample is left unchanged.

    Parameters
    ----------
    folder
        Made if absent; all of it at once, or not at all.
    progress
        Shows long loops.

    Returns
    -------
    Path of the project file.

    Raises
    ------
    InputError
        The folder holds other files, which are left unchanged.
    OutputError
        The folder cannot be written.
    """
    folder = folder.absolute()
    project = folder / "project.yaml"
    if is_sample(project):
        return project
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(
            folder,
            "is there already and holds something else than the sample; nothing was written. Name "
            "a new folder: uavgram pick --sample FOLDER",
        )
    survey = simulate(replace(Scenario(), name="sample"))
    photos = progress(render_photos(survey), "rendering photos", len(survey.frame_id))
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as making:
            made = Path(making) / "whole"
            write_unpicked(
                made, survey, photos, f"{SAMPLE_MARK} mark what its photos show, and measure."
            )
            text = _format_taped(survey)
            (made / TAPE_FILE).write_text(text, encoding="utf-8")
            if folder.exists():  # empty; on Windows it cannot be replaced by a rename
                folder.rmdir()
            made.rename(folder)
    except OSError as fault:
        raise OutputError(
            f"{folder}: cannot be written ({fault.strerror}); name another"
        ) from fault
    return project


def _format_taped(survey: SimulatedSurvey) -> str:
    """Return the taped lengths of the scene, for the page, and true distances."""
    lines, truth = survey.lines, survey.truth
    rows = "\n".join(
        f"{start} to {end}   {length:.2f} m"
        for start, end, length in zip(lines.start, lines.end, truth.line_length_m, strict=True)
    )
    values = dict(zip(truth.measurement_name, truth.measurement_value, strict=True))
    true = "\n".join(
        f"{' to '.join(request.points)}   {values[request.name]:.3f} m"
        for request in survey.measurements
        if request.kind == "distance"
    )
    return (
        "Taped on the scene, to about 1 cm. Use two or more of them on the page as known lengths,\n"
        "and keep the others to compare with what the page measures.\n\n"
        f"{rows}\n\n"
        "The scene is made by the program, so the truth is known. To see how well you measured,\n"
        "here are distances that were not taped; do not enter them as lengths. About two of three\n"
        "values are within one sigma of the truth, and 19 of 20 within two.\n\n"
        f"{true}\n"
    )
