"""Commands `uavgram picks`: import, search in other photos, and tie points."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators

from uavgram.cli.application import DONE, Decimal, Flag, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, progress, set_project_units
from uavgram.errors import InputError

Sigma = Annotated[Decimal | None, Parameter(validator=validators.Number(gt=0))]

picks = App(
    name="picks", help="Picks that no click makes: found in photos, or taken from another program."
)
app.command(picks)


@picks.command(name="import")
def import_(
    files: list[Path],
    /,
    *,
    output: Path,
    control: Path | None = None,
    control_sigma_m: Sigma = None,
    control_sigma_up_m: Sigma = None,
    sigma_columns: Flag = False,
    check: str = "",
    check_file: Path | None = None,
) -> int:
    """Write a picks.csv from LabelMe's JSON files or OpenDroneMap's gcp_list.txt.

    Parameters
    ----------
    files
        LabelMe .json files (points and circles), or one gcp_list.txt.
    output
        The picks.csv to write; one that holds more than a header is never overwritten.
    control
        Also write the coordinates of a gcp_list.txt to this control.csv.
    control_sigma_m
        Standard deviation of those coordinates, which the file does not hold.
    control_sigma_up_m
        Standard deviation of the heights, where it differs; heights of 0 are used only with it.
    sigma_columns
        The cells behind each label are its sigmas in metres: horizontal, and vertical where that
        differs.
    check
        Labels, joined by commas, of points that only judge the result: they go to a check.csv.
    check_file
        That file; by default check.csv beside the control.csv.
    """
    from uavgram.io.imports import GcpSigmas
    from uavgram.pipeline.import_picks import ControlFiles, import_picks
    from uavgram.views.terminal import message_lines

    stated = control_sigma_m is not None or sigma_columns
    if (control is None) == stated:
        raise InputError(
            files[0], "--control and --control-sigma-m (or --sigma-columns) belong together"
        )
    labels = _names(check)
    if control is None and (labels or check_file):
        raise InputError(files[0], "--check needs --control: name the file of the other points")
    sigmas = GcpSigmas(
        sigma_m=control_sigma_m, sigma_up_m=control_sigma_up_m, in_columns=sigma_columns
    )
    coordinates = None
    if control is not None:
        check_path = check_file or control.with_name("check.csv")
        coordinates = ControlFiles(path=control, sigmas=sigmas, check=labels, check_path=check_path)
    done = import_picks(files, output, coordinates)
    print_lines(*message_lines(done.messages))
    print_lines(f"{done.picks} picks of {done.labels} labels in {done.images} photos: {output}")
    if control is not None:
        print_lines(f"{done.control} control points: {control}")
    if coordinates is not None and labels:
        print_lines(f"{done.check} check points: {coordinates.check_path}")
    return DONE


@picks.command
def match(
    project: Path,
    /,
    *,
    labels: str = "",
    photos: str = "",
    dry_run: Flag = False,
    undo: Flag = False,
    verbose: Verbose = False,
) -> int:
    """Find your picks in all other photos, and add them to picks.csv (source `match`).

    Your own picks are never changed. Earlier finds, and those that you accepted on the picking
    page, stay too, except those that no longer fit or whose pick you moved: these are searched
    again. For a new start, remove all of them first (`--undo`).

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml.
    labels
        Only these labels, joined by commas.
    photos
        Only in these photos (their files' names), joined by commas.
    dry_run
        Show the finds, and write nothing.
    undo
        Remove all matches from picks.csv, without a search.
    verbose
        Show the progress of the work.
    """
    from uavgram.pipeline.match.run import match_picks, undo_matches
    from uavgram.pipeline.match.selection import Selection
    from uavgram.views.terminal import match_lines, written_line

    log_to_stderr(verbose=verbose)
    set_project_units(project)
    asked = Selection(_names(labels), _names(photos))
    if undo:
        undone = undo_matches(project, asked, dry_run=dry_run)
        what = "would be taken" if dry_run else "taken"
        print_lines(f"matches {what} out of {undone.path}: {undone.removed}")
        return DONE
    done = match_picks(project, asked, dry_run=dry_run, progress=progress())
    print_lines(*match_lines(done))
    if dry_run:
        print_lines("nothing was written (--dry-run)")
    else:
        print_lines(written_line(done))
    return DONE


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


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
    from uavgram.pipeline.ties_table import remove_ties, write_ties
    from uavgram.views.terminal import message_lines

    set_project_units(project)
    if undo:
        back = remove_ties(project, dry_run=dry_run)
        verb = "taken" if back.written else "would be taken"
        print_lines(f"{back.taken_back} rows of tie points {verb} out of {back.path}")
        return DONE
    done = write_ties(project, dry_run=dry_run, progress=progress())
    print_lines(*message_lines(done.messages))
    verb = "written" if done.written else "would be written"
    print_lines(
        f"{len(set(done.ties.tie))} tie points in {len(set(done.ties.image))} photos, "
        f"{len(done.ties.image)} rows, {verb}: {done.path}"
    )
    return DONE
