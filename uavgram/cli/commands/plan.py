"""`uavgram plan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, say_written, tell_as
from uavgram.errors import UavgramError


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
    scenario: Path | None = None,
    /,
    *,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    output: Path = Path("uavgram-plan"),
    along: TakenAlong | None = None,
    verbose: Verbose = False,
) -> int:
    """Plan a flight: where to photograph from, which lines to tape, and how exact it will be.

    Parameters
    ----------
    scenario
        A scenario with a section `plan:`, such as an edited configs/plan.yaml.
    from_
        Instead a project that was flown: which line more would have helped it most, and what each
        of its lines was worth.
    output
        Folder of the plan: a page to take along, mission files, the plan for maps.
    along
        What is taken to the field.
    verbose
        Say what is being done.
    """
    from uavgram.model.naming import SHORT_FORMS
    from uavgram.synthetic.plan.run import PlanOutputs, write_outputs
    from uavgram.synthetic.plan.run import plan as plan_flight
    from uavgram.views.planned_text import next_line_lines, plan_lines

    log_to_stderr(verbose=verbose)
    if from_ is not None and scenario is None:
        from uavgram.synthetic.plan.next_lines import next_lines

        tell_as(from_)
        say(*next_line_lines(next_lines(from_)))
        return DONE
    if scenario is None or from_ is not None:
        raise UavgramError(
            "name one thing: a scenario to plan for (such as an edited configs/plan.yaml), or by "
            "--from the project of a survey that was flown"
        )
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
