"""Commands `uavgram picks targets`, `uavgram targets print`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators

from uavgram.cli.application import DONE, Decimal, Flag, app
from uavgram.cli.commands.picks import picks
from uavgram.cli.terminal import print_lines, progress, set_project_units
from uavgram.errors import InputError


@picks.command(name="targets")
def find(
    project: Path = Path(),
    /,
    *,
    dry_run: Flag = False,
    undo: Flag = False,
) -> int:
    """Find the targets in the scene in all photos, and pick them.

    For coded plates, the corners are picked. The project states their family and size: `targets:
    {family: aruco-4x4-50, side_m: 0.60, sigma_m: 0.001}`. For chequers, crosses and discs that you
    picked in one photo, the centre is picked in the others, where the target is identified with
    certainty. Rows of picks that you made are never changed; those of an earlier search are
    replaced.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    dry_run
        Show the finds, write nothing.
    undo
        Remove all picks of targets.
    """
    from uavgram.model.naming import counted
    from uavgram.pipeline.targets import find_targets, undo_targets
    from uavgram.views.terminal import message_lines

    set_project_units(project)
    if undo:
        undone = undo_targets(project, dry_run=dry_run)
        would = "would be " if dry_run else ""
        print_lines(f"{undone.removed} picks of targets {would}taken out: {undone.path}")
        return DONE
    found = find_targets(project, dry_run=dry_run, progress=progress())
    print_lines(*message_lines(found.messages))
    for number, photos in found.plates.items():
        sides = [side for _, side in photos]
        if photos:
            print_lines(
                f"T{number}: in {len(photos)} of {found.photos} photos, sides of "
                f"{min(sides):.0f} to {max(sides):.0f} px"
            )
    for label, others in found.uncoded.found.items():
        where = counted(len(others), "more photo")
        print_lines(f"{label}: a {found.uncoded.kinds[label]}, found in {where}")
    done = "nothing is written (--dry-run)" if dry_run else str(found.path)
    more = f" and {len(found.uncoded.found)} other targets" if found.uncoded.found else ""
    print_lines(
        f"{found.rows} picks of {len(found.plates)} plates{more}, {found.removed} before: {done}"
    )
    return DONE


targets = App(name="targets", help="Coded plates to lay into the scene.")
app.command(targets)


@targets.command(name="print")
def print_(
    *,
    output: Path,
    family: str = "aruco-4x4-50",
    plates: str = "0-3",
    side_m: Annotated[Decimal | None, Parameter(validator=validators.Number(gt=0))] = None,
    paper: str = "a4",
) -> int:
    """Write a PDF of coded plates at true size, each with a ruler that checks the printer.

    A drone finds a plate whose black square is 16 pixels wide or more in its photos. Plates larger
    than a page are spread over several, which are cut along their marks and joined.

    Parameters
    ----------
    output
        The PDF to write.
    family
        Family to print: aruco-4x4-50, apriltag-36h11, apriltag-25h9, ..., or a ChArUco board such
        as charuco:6x4:30mm:22mm:DICT_5X5_100.
    plates
        Their numbers, such as 0-3 or 0,2,7.
    side_m
        Side of the black square in metres; by default as large as a page allows.
    paper
        a4, letter, a3, a2, a1 or a0.
    """
    from uavgram.pipeline.print_targets import print_targets

    done = print_targets(family, _numbers(plates), side_m, paper, output)
    each = f", {done.pages} pages each" if done.pages > 1 else ""
    print_lines(f"{len(done.names)} plates ({', '.join(done.names)}){each}: {output}")
    side = "" if done.side_m is None else f", side_m: {done.side_m:g}"
    print_lines(
        "measure the ruler on the paper, then put into the project: "
        f"targets: {{family: {family}{side}}}"
    )
    return DONE


def _numbers(text: str) -> list[int]:
    """Return numbers from ``0-3`` or ``0,2,7``."""
    numbers: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,4})\s*(?:-\s*(\d{1,4})\s*)?", part)
        if match is None:
            raise InputError("--plates", f"{part!r} is no number: write 0-3 or 0,2,7")
        first, last = int(match[1]), int(match[2] or match[1])
        numbers += range(first, last + 1)
    if not numbers:
        raise InputError("--plates", f"{text!r} holds no number: write 0-3 or 0,2,7")
    return list(dict.fromkeys(numbers))
