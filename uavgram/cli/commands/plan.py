"""Command `uavgram plan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import (
    log_to_stderr,
    print_lines,
    print_written_files,
    progress,
    set_project_units,
)
from uavgram.errors import UavgramError


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FieldDocuments:
    """Documents for the field.

    Parameters
    ----------
    pdf
        Write the sheet for the field as PDF too, on this paper.
    units
        Units of the sheet: metres, or feet and inches.
    autopilot
        Autopilot whose commands are used in the mission files.
    heights
        Reference of their heights: the place of take-off, or the autopilot's own terrain data.
    """

    pdf: Literal["a4", "letter"] | None = None
    units: Literal["metric", "imperial"] = "metric"
    autopilot: Literal["ardupilot", "px4"] = "ardupilot"
    heights: Literal["relative", "terrain"] = "relative"


@app.command
def plan(
    scenario: Path | None = None,
    /,
    *,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    output: Path = Path("uavgram-plan"),
    along: FieldDocuments | None = None,
    verbose: Verbose = False,
) -> int:
    """Plan a flight: positions of the photos, lines to tape, and the expected accuracy.

    Parameters
    ----------
    scenario
        A scenario with a section `plan:`, such as an edited configs/plan.yaml.
    from_
        Instead a project that was flown: the additional line that would have helped it most, and
        the benefit of each of its lines.
    output
        Folder of the plan: a page for the field, mission files, the plan for maps.
    along
        Documents for the field.
    verbose
        Show the progress of the work.
    """
    from uavgram.model.naming import SHORT_FORMS
    from uavgram.synthetic.plan.plan import PlanOutputs, write_outputs
    from uavgram.synthetic.plan.plan import plan as plan_flight
    from uavgram.views.flight_plan_text import next_line_lines, plan_lines

    log_to_stderr(verbose=verbose)
    if from_ is not None and scenario is None:
        from uavgram.synthetic.plan.next_lines import find_next_lines

        set_project_units(from_)
        print_lines(*next_line_lines(find_next_lines(from_)))
        return DONE
    if scenario is None or from_ is not None:
        raise UavgramError(
            "name one thing: a scenario to plan for (such as an edited configs/plan.yaml), or by "
            "--from the project of a survey that was flown"
        )
    planned, as_flown = plan_flight(scenario, progress())
    taken = along or FieldDocuments()
    made = PlanOutputs(**vars(taken) | {"units": SHORT_FORMS[taken.units]})
    written = write_outputs(planned, as_flown, output, scenario, made)
    print_lines(*plan_lines(planned))
    print_written_files(output, written)
    return DONE
