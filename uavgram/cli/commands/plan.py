"""`uavgram plan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cyclopts import Parameter

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, say_written


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class TakenAlong:
    """What is taken to the field.

    Parameters
    ----------
    pdf
        Write the sheet for the field as PDF too, on this paper.
    units
        Of the sheet: metres, or feet and inches.
    autopilot
        Whose commands the mission files are written in.
    heights
        What their heights count from: the place of take-off, or the autopilot's own terrain data.
    """

    pdf: Literal["a4", "letter"] | None = None
    units: Literal["metric", "imperial"] = "metric"
    autopilot: Literal["ardupilot", "px4"] = "ardupilot"
    heights: Literal["relative", "terrain"] = "relative"


@app.command
def plan(
    scenario: Path,
    /,
    *,
    output: Path = Path("uavgram-plan"),
    along: TakenAlong | None = None,
    verbose: Verbose = False,
) -> int:
    """Plan a flight: where to photograph from, which lines to tape, and how exact it will be.

    Parameters
    ----------
    scenario
        A scenario with a section `plan:`, such as an edited configs/plan.yaml.
    output
        Folder of the plan: a page to take along, mission files, the plan for maps.
    along
        What is taken to the field.
    verbose
        Say what is being done.
    """
    from uavgram.model.units import SHORT_FORMS
    from uavgram.pipeline.plan.run import PlanOutputs, write_outputs
    from uavgram.pipeline.plan.run import plan as plan_flight
    from uavgram.views.planned_text import plan_lines

    log_to_stderr(verbose=verbose)
    planned, as_flown = plan_flight(scenario, progress())
    taken = along or TakenAlong()
    made = PlanOutputs(
        units=SHORT_FORMS[taken.units],
        pdf=taken.pdf,
        autopilot=taken.autopilot,
        heights=taken.heights,
    )
    written = write_outputs(planned, as_flown, output, scenario, made)
    say(*plan_lines(planned))
    say_written(output, written)
    return DONE
