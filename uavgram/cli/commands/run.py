"""Command `uavgram run`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, VERDICT, Flag, Json, Seed, Verbose, app
from uavgram.cli.terminal import (
    log_to_stderr,
    print_json,
    print_lines,
    progress,
    set_project_units,
    set_result,
    warn_of,
)

TABLE_ROWS = 40
Rows = Annotated[int, Parameter(validator=validators.Number(gte=0))]
Scale = Annotated[int, Parameter(validator=validators.Number(gte=1, lte=1_000_000))]
Samples = Annotated[
    int, Parameter(name="--monte-carlo", validator=validators.Number(gte=100, lte=1_000_000))
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PrintOptions:
    """Documents for printing.

    Parameters
    ----------
    pdf
        Write the report as report.pdf too, on this paper: for archives (PDF/A-3b) and for printing.
    plan
        Draw a plan to scale on the ground in the photos: plan.pdf on this paper, plan.png and
        plan.tif.
    plan_scale
        Scale of that plan, on as many sheets as necessary: 100 is 1:100; by default one sheet.
    """

    pdf: Literal["a4", "letter"] | None = None
    plan: Literal["a4", "letter"] | None = None
    plan_scale: Scale | None = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ProgramOptions:
    """Options for other programs that start this one.

    Parameters
    ----------
    json
        Print a JSON object (verdict, measurements, checks, messages) instead of text.
    fail_on
        Exit with status 3 where the verdict is this or worse, and print it on standard error; the
        results are still written.
    """

    json: Json = False
    fail_on: Literal["red", "amber"] | None = None


@app.command
def run(
    project: Path = Path(),
    /,
    *,
    output: Path | None = None,
    monte_carlo: Samples | None = None,
    seed: Seed = 0,
    rows: Rows = TABLE_ROWS,
    view: Flag = False,
    printed: PrintOptions | None = None,
    programs: ProgramOptions | None = None,
    verbose: Verbose = False,
) -> int:
    """Measure: read the project, adjust, and write all outputs.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    output
        Folder of the outputs; by default the one that the project names.
    monte_carlo
        Repeat the adjustment N times with new random errors, and compare the sigmas.
    seed
        Seed of those draws.
    rows
        Largest number of measurements in the table, least certain first; 0: all of them.
    view
        Open the review in the Rerun viewer afterwards.
    printed
        Documents for printing.
    programs
        Options for other programs that start this one.
    verbose
        Show the progress of the work.
    """
    from uavgram.cli.commands.view import show
    from uavgram.cli.json_objects import run_object
    from uavgram.config.project import load_project
    from uavgram.model.maps import PlanPaper
    from uavgram.pipeline.measure.compute import Sampling
    from uavgram.pipeline.measure.run import FROM_PROJECT
    from uavgram.pipeline.measure.run import run as run_project
    from uavgram.views.survey.verdict import verdict_sentence
    from uavgram.views.terminal import findings_lines, hidden_rows_line, measurement_table

    log_to_stderr(verbose=verbose)
    set_project_units(project)
    paper = PrintOptions() if printed is None else printed
    plan = None if paper.plan is None else PlanPaper(paper.plan, paper.plan_scale)
    sampling = None if monte_carlo is None else Sampling(monte_carlo, seed)
    target = FROM_PROJECT if output is None else output
    result = run_project(project, target, progress(), sampling, paper.pdf, plan)
    set_result(result)
    folder = Path(load_project(project).output) if output is None else output
    wanted = ProgramOptions() if programs is None else programs
    if wanted.json:
        print_json(run_object(result, folder))
    else:
        print_lines(measurement_table(result, rows), *hidden_rows_line(result, rows, folder))
        print_lines(*findings_lines(result, verbose=verbose))
    if view:
        show(folder / "recording.rrd", web=False)
    fails = {"red": ("red",), "amber": ("red", "amber"), None: ()}[wanted.fail_on]
    level = result.verdict.level
    if level in {"red", "amber"}:
        warn_of(verdict_sentence(result), only_quiet=level not in fails)
    return VERDICT if level in fails else DONE
