"""Built-in survey: simulated, rendered and written to a folder; either run, or left unpicked."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from uavgram.errors import InputError, OutputError
from uavgram.model.camera import Calibration
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.synthetic.accident_scene import SAMPLE_MARK, TAPE_FILE, is_sample
from uavgram.synthetic.files import write_demo, write_unpicked
from uavgram.synthetic.picture.render import render_photos
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate


@with_one_blas_thread
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


@with_one_blas_thread
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
