"""`uavgram picks targets`, `uavgram targets print`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Flag
from uavgram.cli.commands.picks import picks
from uavgram.cli.terminal import progress, say


@picks.command(name="targets")
def find(
    project: Path = Path(),
    /,
    *,
    dry_run: Flag = False,
    undo: Flag = False,
) -> int:
    """Find the coded plates that lie in the scene, in all photos, and pick their corners.

    The project says what is printed on them, and how large they are:
    `targets: {family: aruco-4x4-50, side_m: 0.60, sigma_m: 0.001}`. Rows of picks that you made are
    never changed; those of an earlier search are replaced.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    dry_run
        Say what would be found, write nothing.
    undo
        Take all picks of targets out again.
    """
    from uavgram.pipeline.targets import find_targets, undo_targets
    from uavgram.views.terminal import message_lines

    if undo:
        undone = undo_targets(project, dry_run=dry_run)
        would = "would be " if dry_run else ""
        say(f"{undone.removed} picks of targets {would}taken out: {undone.path}")
        return DONE
    found = find_targets(project, dry_run=dry_run, progress=progress())
    say(*message_lines(found.messages))
    for number, photos in found.plates.items():
        sides = [side for _, side in photos]
        if photos:
            say(
                f"T{number}: in {len(photos)} of {found.photos} photos, sides of {min(sides):.0f} to "
                f"{max(sides):.0f} px"
            )
    done = "nothing is written (--dry-run)" if dry_run else str(found.path)
    say(f"{found.rows} picks of {len(found.plates)} plates, {found.removed} before: {done}")
    return DONE
