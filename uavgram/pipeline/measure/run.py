"""Run a project: read, compute, and write all outputs or none."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Literal

from uavgram.imaging.photos.preview import Pixels, Preview, jpeg_preview_scale, read_preview
from uavgram.imaging.top_view.mosaic import GroundTexture, Mosaic
from uavgram.io.digest import photo_files
from uavgram.io.outputs import replace_bytes, staged_output
from uavgram.io.own_files import check_folder_of_project
from uavgram.io.results.results_json import write_results
from uavgram.model.maps import PLAN_PDF, Paper, PlanWish
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.pipeline.measure.compute import Sampling, compute
from uavgram.pipeline.measure.exports import exports
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.journal import Journal
from uavgram.pipeline.measure.pictures import (
    ReportPictures,
    carried,
    ground_picture,
    with_thinning_told,
)
from uavgram.pipeline.measure.tie_points import are_missing, pose_before_ties, with_ties_found
from uavgram.pipeline.parallel import prefetch
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.summarise import tie_cloud
from uavgram.views.recording.write import write_recording
from uavgram.views.report import annex_of, check_pdf, report_pdf, write_report


class _Output(Enum):
    FROM_PROJECT = "as the project says"


FROM_PROJECT = _Output.FROM_PROJECT
"""Write to the folder that the project names."""

OutputChoice = str | os.PathLike[str] | None | Literal[_Output.FROM_PROJECT]


@with_one_blas_thread
def run(
    project: str | os.PathLike[str],
    output: OutputChoice = FROM_PROJECT,
    progress: Progress = silent,
    sampling: Sampling | None = None,
    pdf: Paper | None = None,
    plan: PlanWish | None = None,
    *,
    hold: Callable[[], None] | None = None,
) -> Result:
    """Run a project from its inputs to its outputs.

    Parameters
    ----------
    project
        The project file.
    output
        Folder of the outputs; by default the one that the project names, None: write nothing.
    progress
        Shows long loops.
    sampling
        Monte Carlo check of the measurements.
    pdf
        Paper of a report.pdf; None: there is none.
    plan
        Paper and scale of plan.pdf and plan.png; None: there is none.
    hold
        Raises where another process may write the outputs by now, as for `staged_output`.

    Returns
    -------
    Result
        The content of results.json.

    Raises
    ------
    UavgramError
        A problem that the user can solve. Earlier results are untouched.
    """
    journal = Journal()
    if pdf is not None:
        check_pdf()
    with journal.step("read the inputs"):
        inputs = read_inputs(Path(project))
    folder = inputs.project.output if output is FROM_PROJECT else output
    if output is FROM_PROJECT:
        check_folder_of_project(Path(inputs.project.output), Path(project).absolute().parent)
    posed = None
    if are_missing(inputs):
        with journal.step("find tie points"):
            posed = pose_before_ties(inputs)
            inputs = with_ties_found(inputs, posed, write=folder is not None, progress=progress)
            posed = None if posed.telemetry is None else posed
    with journal.step("adjust and measure"):
        result, refined = compute(inputs, sampling, posed=posed)
        ties = tie_cloud(refined.adjustment, result.frames.frame_id)
    if folder is not None:
        result = with_thinning_told(result)
    journal.result(result)
    if folder is not None:
        with staged_output(Path(folder), inputs.files, inputs.photos.path, hold) as staging:
            _write_outputs(result, ties, staging, journal, progress, pdf, plan)
    return result


def _write_outputs(
    result: Result,
    ties: TieCloud | None,
    folder: Path,
    journal: Journal,
    progress: Progress,
    pdf: Paper | None = None,
    plan: PlanWish | None = None,
) -> None:
    parts = ReportPictures(result)
    with journal.step("write recording.rrd"):
        texture = write_review(result, folder / "recording.rrd", progress, ties, parts)
    with journal.step("put the report's pictures together"):
        pictures = replace(parts.pictures(), ground=ground_picture(result, texture))
    writers: dict[str, Callable[[Path], None]] = {
        **exports(result, texture),
        "report.html": lambda path: write_report(result, path, pictures),
        "results.json": lambda path: write_results(result, path),
    }
    if pdf is not None:
        writers["report.pdf"] = lambda path: write_pdf(result, path, pdf)
    if plan is not None:
        from uavgram.pipeline.measure.plan import write_plan  # noqa: PLC0415 - loads matplotlib

        writers[PLAN_PDF] = lambda path: write_plan(result, plan, path.parent)
    for name, write in progress(writers.items(), "writing", len(writers)):
        with journal.step(f"write {name}"):
            (folder / name).parent.mkdir(exist_ok=True)
            write(folder / name)
    journal.write(folder / "run.jsonl")


def write_pdf(result: Result, path: Path, paper: Paper) -> None:
    """Write report and annex as PDF, from their pages and results.json beside them.

    Parameters
    ----------
    result
        Result of a run.
    path
        The report to write; the annex is beside it, as by `annex_of`.
    paper
        Their size.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    results = path.with_name("results.json").read_text(encoding="utf-8")
    made = result.provenance.created_utc
    for file, attach in ((path, True), (annex_of(path), False)):
        html = file.with_suffix(".html").read_text(encoding="utf-8")
        replace_bytes(file, report_pdf(html, results, paper, result.name, made, attach=attach))


def write_review(
    result: Result,
    path: Path,
    progress: Progress = silent,
    ties: TieCloud | None = None,
    parts: ReportPictures | None = None,
) -> GroundTexture | None:
    """Write the recording of a result, with its photos and the ground in them.

    With very many photos it contains a selection (see `carried`), while all show the ground. They
    are processed one by one: the used memory does not grow with their number.

    Parameters
    ----------
    result
        Result of a run.
    path
        The recording to write.
    progress
        Shows long loops.
    ties
        Tie points, where there are any.
    parts
        Parts of the photos for the report.

    Returns
    -------
    GroundTexture
        The ground; None where photos show none of it.

    Raises
    ------
    InputError
        A photo cannot be read.
    OutputError
        The file cannot be written.
    """
    names = result.frames.frame_id
    shown_photos = {names[row] for row in carried(len(names))}
    mosaic = Mosaic(result, names, jpeg_preview_scale(result.camera.width_px))

    def reduced_photo(path: str) -> tuple[Preview, Pixels]:
        return parts.cut(path) if parts and parts.wants(path) else read_preview(path)

    def photos() -> Iterator[tuple[str, Preview]]:
        reduced = prefetch(reduced_photo, photo_files(result.frames))
        shown = progress(zip(names, reduced, strict=True), "photos", len(names))
        for name, (_, (preview, pixels)) in shown:
            mosaic.add(name, pixels)
            if name in shown_photos:
                yield name, preview

    shown: list[GroundTexture | None] = []

    def texture() -> GroundTexture | None:
        shown.append(mosaic.texture())
        return shown[-1]

    write_recording(result, photos(), texture, path, ties)
    return shown[-1] if shown else None
