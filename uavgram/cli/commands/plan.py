"""`uavgram plan`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, say_written


@app.command
def plan(
    scenario: Path,
    /,
    *,
    output: Path = Path("uavgram-plan"),
    verbose: Verbose = False,
) -> int:
    """Plan a flight: where to photograph from, which lines to tape, and how exact it will be.

    Parameters
    ----------
    scenario
        A scenario with a section `plan:`, such as an edited configs/plan.yaml.
    output
        Folder of the plan: a page to take along, mission files, the plan for maps.
    verbose
        Say what is being done.
    """
    from uavgram.pipeline.plan.run import plan as plan_flight
    from uavgram.pipeline.plan.run import write_outputs
    from uavgram.views.planned_text import plan_lines

    log_to_stderr(verbose=verbose)
    planned, as_flown = plan_flight(scenario, progress())
    written = write_outputs(planned, as_flown, output, scenario)
    say(*plan_lines(planned))
    say_written(output, written)
    return DONE
