"""`uavgram plan`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, say_written, tell_as
from uavgram.errors import UavgramError


@app.command
def plan(
    scenario: Path | None = None,
    /,
    *,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    output: Path = Path("uavgram-plan"),
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
    verbose
        Say what is being done.
    """
    from uavgram.pipeline.plan.run import plan as plan_flight
    from uavgram.pipeline.plan.run import write_outputs
    from uavgram.views.planned_text import next_line_lines, plan_lines

    log_to_stderr(verbose=verbose)
    if from_ is not None and scenario is None:
        from uavgram.pipeline.plan.next_lines import next_lines

        tell_as(from_)
        say(*next_line_lines(next_lines(from_)))
        return DONE
    if scenario is None or from_ is not None:
        raise UavgramError(
            "name one thing: a scenario to plan for (such as an edited configs/plan.yaml), or by "
            "--from the project of a survey that was flown"
        )
    planned, as_flown = plan_flight(scenario, progress())
    written = write_outputs(planned, as_flown, output, scenario)
    say(*plan_lines(planned))
    say_written(output, written)
    return DONE
