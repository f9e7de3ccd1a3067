"""Run a project: read, compute, write all outputs or none, and log the steps."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Literal

from uavgram.io.files import check_folder_of_project
from uavgram.io.outputs import stage_output
from uavgram.model.maps import Paper, PlanPaper
from uavgram.model.naming import join_names
from uavgram.model.result.result import Result
from uavgram.model.work import report_work
from uavgram.pipeline.measure.compute import Sampling, compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.tie_points import add_found_ties, are_ties_missing, pose_before_ties
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.summarise import tie_cloud

log = logging.getLogger(__name__)


class Journal:
    """Records of one run, in order; the only object of a run that grows."""

    def __init__(self) -> None:
        self._lines: list[dict[str, object]] = []

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step; a failed step leaves no record, as the run leaves no file."""
        log.info("%s", name)
        report_work(name)
        started = time.perf_counter()
        yield
        self.note("step", name=name, seconds=round(time.perf_counter() - started, 4))

    def note(self, event: str, **fields: object) -> None:
        """Add a record."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._lines.append({"time_utc": now, "event": event, **fields})

    def result(self, result: Result) -> None:
        """Record the solution and the messages of the run."""
        solution = result.solution
        self.note(
            "solution",
            iterations=solution.iterations,
            converged=solution.converged,
            degrees_of_freedom=solution.degrees_of_freedom,
        )
        for message in result.messages:
            self.note("message", **message.record())

    def write(self, path: Path) -> None:
        """Write one JSON object per line."""
        text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in self._lines)
        path.write_text(text, encoding="utf-8")


class _Output(Enum):
    FROM_PROJECT = "as the project states"


FROM_PROJECT = _Output.FROM_PROJECT
"""Write to the folder that the project names."""

OutputChoice = str | os.PathLike[str] | None | Literal[_Output.FROM_PROJECT]


@limit_blas_threads
def run(
    project: str | os.PathLike[str],
    output: OutputChoice = FROM_PROJECT,
    progress: Progress = silent,
    sampling: Sampling | None = None,
    pdf: Paper | None = None,
    plan: PlanPaper | None = None,
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
        Raises where another process may write the outputs by now, as for `stage_output`.

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
        from uavgram.views.report import check_pdf  # noqa: PLC0415 - loads the report

        check_pdf()
    with journal.step("read the inputs"):
        inputs = read_inputs(Path(project))
    folder = inputs.project.output if output is FROM_PROJECT else output
    if output is FROM_PROJECT:
        check_folder_of_project(Path(inputs.project.output), Path(project).absolute().parent)
    posed = None
    if are_ties_missing(inputs):
        with journal.step("find tie points"):
            posed = pose_before_ties(inputs)
            inputs = add_found_ties(inputs, posed, write=folder is not None, progress=progress)
            posed = None if posed.telemetry is None else posed
    with journal.step("adjust and measure"):
        result, refined = compute(inputs, sampling, posed=posed)
        ties = tie_cloud(refined.adjustment, result.frames.frame_id)
    if folder is None:
        journal.result(result)
        return result
    from uavgram.pipeline.measure import outputs  # noqa: PLC0415 - load Rerun and ezdxf

    result = outputs.note_thinning(result)
    journal.result(result)
    with stage_output(Path(folder), inputs.files, inputs.photos.path, hold) as staging:
        outputs.write_outputs(result, ties, staging, journal, progress, pdf, plan)
        earlier = outputs.list_earlier(Path(folder), staging)
    if earlier:
        log.warning(
            "an earlier run wrote %s in %s, and this one did not: that may contradict the new "
            "results; remove it, or write it again (--pdf, --plan)",
            join_names(earlier),
            folder,
        )
    return result
