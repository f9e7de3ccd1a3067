"""The built-in survey: simulated, photographed, written to a folder, and run like any other."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from uavgram.imaging.demo_scene.render import render_photos
from uavgram.io.demo_files import write_demo
from uavgram.model.camera.calibration import Calibration
from uavgram.model.result.result import Result
from uavgram.model.scenario.scenario import Scenario
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.simulate.survey import simulate


@with_one_blas_thread
def demo(
    folder: Path,
    scenario: Scenario,
    progress: Progress = silent,
    calibration: Calibration | None = None,
) -> tuple[Result, Mapping[str, float], Path]:
    """Make a survey with known truth, and run it.

    Parameters
    ----------
    folder
        Where its files go; made if absent.
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
