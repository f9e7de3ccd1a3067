"""Measure one survey of a batch in a worker, unless it is unchanged; its row in the table."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from uavgram.config.project import load_project
from uavgram.errors import InputError, UavgramError
from uavgram.io.files import photo_files
from uavgram.io.outputs import LAST_MOVED, SupersededError, claim_folder
from uavgram.io.photos.catalogue import find_photos
from uavgram.io.photos.metadata import read_camera_tags
from uavgram.io.results.command_json import (
    append_record,
    is_unchanged,
    read_file_stat,
    read_file_state,
    read_records,
)
from uavgram.model.arrays import Floats
from uavgram.model.batch import FileState, Fit, ParameterUpdate, SurveyRecord, SurveyRow
from uavgram.model.maps import Paper
from uavgram.model.options import Project
from uavgram.model.result.result import Result, compare_cameras
from uavgram.pipeline.measure.inputs import named_files
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.versions import stamp
from uavgram.views.survey.verdict import verdict_sentence

POOLED_GROUPS = ("pixels", "lengths", "telemetry")


def row_of(result: Result, project: str, output: str, seconds: float) -> SurveyRow:
    """Return the table row of a measured survey.

    Parameters
    ----------
    result
        Result of its run.
    project
        Its project file.
    output
        Folder of its results.
    seconds
        Computing time.
    """
    origin = result.world.origin
    nowhere = (math.nan, math.nan)
    place = nowhere if origin is None else (origin.latitude_deg, origin.longitude_deg)
    warnings = (one.code for one in result.messages if one.level != "info")
    sigmas = result.measurements.sigma[[unit == "m" for unit in result.measurements.unit]]
    return SurveyRow(
        name=result.name,
        project=project,
        status="done",
        level=result.verdict.level,
        sentence=verdict_sentence(result),
        taken_utc=_taken(result.frames.time_utc_s),
        latitude_deg=place[0],
        longitude_deg=place[1],
        camera=result.camera.name,
        drone=_drone(photo_files(result.frames)),
        photos=len(result.frames.frame_id),
        measurements=len(result.measurements.name),
        mean_sigma_m=_mean(sigmas),
        worst_w=_largest(result.picks.w, result.lines.w, result.line_checks.z),
        warnings=tuple(dict.fromkeys(warnings)),
        output=output,
        seconds=seconds,
        fits=tuple(_fits(result)),
        seen=_seen(result),
    )


def _taken(times: Floats) -> str:
    known = times[np.isfinite(times)]
    if not known.size:
        return ""
    return datetime.fromtimestamp(float(known.mean()), UTC).isoformat(timespec="seconds")


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else math.nan


def _largest(*values: Floats) -> float:
    known = np.concatenate(values)
    known = known[np.isfinite(known)]
    return float(known[np.abs(known).argmax()]) if known.size else math.nan


def _drone(photos: tuple[str, ...]) -> str:
    """Return make, model and serial number in the first photo; empty where not stated."""
    try:
        tags = read_camera_tags(photos[0])
    except InputError:
        return ""
    return " ".join(filter(None, (tags.camera_name, tags.serial)))


def _fits(result: Result) -> Iterator[Fit]:
    checks = result.checks_overall
    if checks is not None and math.isfinite(checks.chi2) and checks.count:
        yield Fit(kind="checks", squares=checks.chi2, freedom=float(checks.count))
    for group in result.solution.groups:
        squares = group.variance_factor * group.redundancy
        if group.name in POOLED_GROUPS and group.redundancy > 0 and math.isfinite(squares):
            yield Fit(kind=group.name, squares=squares, freedom=group.redundancy)


def _seen(result: Result) -> tuple[ParameterUpdate, ...]:
    found = compare_cameras(result.camera, result.shared.intrinsics)
    columns = (found.prior_value, found.prior_sigma, found.value, found.sigma)
    rows = zip(found.names, *(column.tolist() for column in columns), strict=True)
    return tuple(
        ParameterUpdate(name=name, stated=stated, stated_sigma=prior, value=value, sigma=sigma)
        for name, stated, prior, value, sigma in rows
        if prior > 0
    )


LEFT = ".uavgram-measured.jsonl"
"""File in the output folder with the record of a worker's result, until the batch has received
it."""


@dataclass(frozen=True, kw_only=True)
class Requests:
    """Requests of a batch for each survey, beside its project file: paper of a report.pdf."""

    pdf: Paper | None = None


@dataclass(frozen=True, kw_only=True)
class Task:
    """Survey to measure.

    Attributes
    ----------
    project
        Its project file.
    asked
        Requests.
    before
        Record of an earlier run, if any.
    results
        Size and time of its results.json when the survey was given to a worker of a cluster, which
        may begin late, when another one has finished it; None: impossible.
    """

    project: str
    asked: Requests
    before: SurveyRecord | None = None
    results: tuple[int, int] | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a survey: its row, and its record; None if it must be measured again next time."""

    row: SurveyRow
    record: SurveyRecord | None


def measure_survey(task: Task) -> Outcome:
    """Measure a survey, unless it is unchanged since the last run; report its problems in the row.

    Parameters
    ----------
    task
        The survey.

    Raises
    ------
    SupersededError
        Another process measures it, or did: nothing was written.
    """
    try:
        return _measure(task)
    except SupersededError:
        raise
    except UavgramError as fault:
        why = str(fault)
    except MemoryError:
        why = (
            "needs more memory than a worker of the batch may take: run it alone (uavgram run), or "
            "the batch with fewer workers (--workers 1)"
        )
    except Exception as fault:  # noqa: BLE001 (a bug in one survey must not stop the others)
        where = traceback.extract_tb(fault.__traceback__)[-1]
        why = (
            f"the program failed ({type(fault).__name__}: {fault}, in {Path(where.filename).name} "
            f"line {where.lineno}): this is a bug, please report it with this survey"
        )
    return failure_outcome(task, why)


def failure_outcome(task: Task, why: str) -> Outcome:
    """Return the outcome of a survey without results, with the reason."""
    row = SurveyRow(name=name_of(task.project), project=task.project, status="failed", message=why)
    return Outcome(row=row, record=None)


def add_present_results(task: Task) -> Task:
    """Add the present state of the results, before a survey is given to a worker of a cluster."""
    try:
        output = load_project(Path(task.project)).output
    except UavgramError:  # reported when it is measured
        return task
    return replace(task, results=read_file_stat(Path(output) / LAST_MOVED))


def name_of(project: str) -> str:
    """Return the name of a survey in the table where its project cannot be read."""
    path = Path(project)
    return path.absolute().parent.name if path.stem == "project" else path.stem


def _measure(task: Task) -> Outcome:
    path = Path(task.project)
    project = load_project(path)
    if task.before is not None and _is_unchanged(task, task.before, project):
        return Outcome(row=replace(task.before.row, status="unchanged"), record=task.before)
    left = _recover_result(task, project)
    if left is not None:
        return Outcome(row=left.row, record=left)
    if task.results is not None and task.results != read_file_stat(
        Path(project.output) / LAST_MOVED
    ):
        raise SupersededError(project.output)
    begun, before = time.process_time(), _stats(_inputs(path, project))
    with _claim_folder(project) as hold:
        result = run(path, pdf=task.asked.pdf, hold=hold)
    row = row_of(result, task.project, str(project.output), time.process_time() - begun)
    states = _states(result, path.absolute().parent, before)
    if states is None:
        return Outcome(row=row, record=None)
    record = SurveyRecord(
        row=row,
        version=stamp()["version"],
        asked=repr(task.asked),
        inputs=states,
        results=read_file_state(Path(project.output) / LAST_MOVED),
    )
    if task.results is not None:
        with suppress(OSError):  # then it is measured again if the record is lost
            append_record(Path(project.output) / LEFT, record)
    return Outcome(row=row, record=record)


def _recover_result(task: Task, project: Project) -> SurveyRecord | None:
    """Return the result of a worker interrupted before its report, if it is still valid."""
    path = Path(project.output) / LEFT
    found = read_records(path).get(task.project)
    with suppress(OSError):
        path.unlink(missing_ok=True)
    return found if found is not None and _is_unchanged(task, found, project) else None


def remove_record(outcome: Outcome) -> None:
    """Remove the record of a result that a worker of a cluster has reported."""
    with suppress(OSError):
        (Path(outcome.row.output) / LEFT).unlink(missing_ok=True)


def _claim_folder(project: Project) -> AbstractContextManager[Callable[[], None] | None]:
    """Claim the output folder; no claim to one that will be refused, as it holds the photos."""
    output = Path(project.output).resolve()
    if any(Path(one).resolve().parent == output for one in find_photos(project.images)):
        return nullcontext()
    return claim_folder(project.output)


def _inputs(path: Path, project: Project) -> list[str]:
    named = named_files(path, project, project.picks, project.lines, project.measure)
    photos = map(str, find_photos(project.images))
    return [str(Path(one).absolute()) for one in (*named, *photos)]


def _is_unchanged(task: Task, before: SurveyRecord, project: Project) -> bool:
    """Return whether a run would give the existing results."""
    if (before.version, before.asked) != (stamp()["version"], repr(task.asked)):
        return False
    if {one.path for one in before.inputs} != set(_inputs(Path(task.project), project)):
        return False
    if before.results.path != str(Path(project.output) / LAST_MOVED):
        return False
    return all(map(is_unchanged, (before.results, *before.inputs)))


def _stats(paths: list[str]) -> dict[str, tuple[int, int]]:
    return {path: read_file_stat(path) for path in paths}


def _states(
    result: Result, folder: Path, before: dict[str, tuple[int, int]]
) -> tuple[FileState, ...] | None:
    """Return the files read by the run, from its provenance; None where one changed meanwhile."""
    states = []
    for one in result.provenance.inputs:
        path = str(folder / one.path)
        size, changed = read_file_stat(path)
        # a table of ties that the run itself found was not there before
        if before.get(path, (size, changed)) != (size, changed) or size != one.size_bytes:
            return None
        states.append(FileState(path=path, size_bytes=size, changed_ns=changed, sha256=one.sha256))
    return tuple(states)
