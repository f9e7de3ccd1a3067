"""Command `uavgram picks ties`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Flag
from uavgram.cli.commands.picks import picks
from uavgram.cli.terminal import progress, say, tell_as


@picks.command
def ties(project: Path = Path(), /, *, dry_run: Flag = False, undo: Flag = False) -> int:
    """Find points that several photos show, without a click, and write them to ties.csv.

    They tie the photos to each other. Earlier rows by the program are replaced, those from other
    sources stay.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    dry_run
        Show the finds, and write nothing.
    undo
        Remove all tie points that the program found from the table.
    """
    from uavgram.pipeline.picks_ties import take_ties_back, write_ties
    from uavgram.views.terminal import message_lines

    tell_as(project)
    if undo:
        back = take_ties_back(project, dry_run=dry_run)
        verb = "taken" if back.written else "would be taken"
        say(f"{back.taken_back} rows of tie points {verb} out of {back.path}")
        return DONE
    done = write_ties(project, dry_run=dry_run, progress=progress())
    say(*message_lines(done.messages))
    verb = "written" if done.written else "would be written"
    say(
        f"{len(set(done.ties.tie))} tie points in {len(set(done.ties.image))} photos, "
        f"{len(done.ties.image)} rows, {verb}: {done.path}"
    )
    return DONE
