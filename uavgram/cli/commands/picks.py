"""Commands on picks and targets: `uavgram pick`, `picks import` and others, `targets print`."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators

from uavgram.cli.application import DONE, Decimal, Flag, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, progress, set_project_units
from uavgram.errors import InputError

Port = Annotated[int, Parameter(validator=validators.Number(gte=0, lte=65535))]


@app.command
def pick(
    project: Path | None = None,
    /,
    *,
    sample: Flag = False,
    port: Port = 0,
    browser: bool = True,
    verbose: Verbose = False,
) -> int:
    """Pick points and lengths in the photos on a local page, and see the measurements.

    The project may lack picks, lengths and measurements: they are made here. A folder without a
    project is set up on the page, and without a folder one is chosen there: `uavgram FOLDER` and
    `uavgram` alone do the same. Everything is saved at once. Ctrl+C ends it, and so do ten minutes
    without an open tab.

    While it runs, the same command again opens a lost tab again, and another project in its place.

    Parameters
    ----------
    project
        The project file, or a folder with or without a project; by default the present folder, if
        it holds a project or photos.
    sample
        Make a small survey for practice (photos, flight log and camera, nothing picked) in the
        named folder, by default uavgram-sample, and open it; an existing one is continued.
    port
        Port of the page, on this machine only; 0: any free one. With a port, a second page runs
        beside the first, with another project.
    browser
        Open the page in the browser.
    verbose
        Show the progress of the work.
    """
    import contextlib
    import os

    # Small systems many times a second: threads inside one of them only wait for each other, and
    # the browser needs the processors too. Read when numpy is loaded, which is below.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    from uavgram.picking.web.running_server import wait_for_other_start

    log_to_stderr(verbose=verbose)
    wanted = _sample(project) if sample else project or _find_present_folder()
    if wanted is not None and not _lacks_project(wanted):
        set_project_units(wanted)
    with contextlib.ExitStack() as starting:
        starting.enter_context(wait_for_other_start())
        if _find_running_page(wanted, port, browser=browser):
            return DONE
        return _serve(wanted, port, starting.close, browser=browser)


def _lacks_project(folder: Path) -> bool:
    """Return whether it is a folder without a project, to be set up on the page."""
    from uavgram.config.project import PROJECT_FILE

    return folder.is_dir() and not (folder / PROJECT_FILE).exists()


def _find_present_folder() -> Path | None:
    """Return the present folder, if it holds a project or photos."""
    from uavgram.io.folders import count_photos, find_home_and_drives

    return Path() if count_photos(Path.cwd()).is_flight(find_home_and_drives()) else None


def _sample(folder: Path | None) -> Path:
    """Return the project of the sample, which is made if it does not exist yet."""
    from uavgram.synthetic.accident_scene import TAPE_FILE
    from uavgram.synthetic.demo import SAMPLE_NAME, make_sample

    made = make_sample(folder or Path(SAMPLE_NAME), progress())
    print_lines(
        f"Sample to play with: {made.parent}; its taped lengths: {made.with_name(TAPE_FILE)}"
    )
    return made


def _find_running_page(wanted: Path | None, port: int, *, browser: bool) -> bool:
    """Open a new tab of a page that runs; return whether there is one.

    With a port, only a page that has the project open, or has that port, is asked.
    """
    from uavgram.config.project import load_project
    from uavgram.picking.web.running_server import request_address

    is_project = wanted is None or wanted.is_dir() or wanted.suffix in {".yaml", ".yml"}
    if wanted is not None and not (is_project and wanted.exists()):
        load_project(
            wanted, unfinished=True
        )  # reports what it is; the page shows a project's faults
    fresh = request_address(wanted, lambda door: port in {0, door.port})
    if fresh is None:
        return False
    opened = "a new tab opens" if browser else "open"
    print_lines(
        f"The page runs already; {opened}: {fresh.text}", "It works once, within five minutes."
    )
    if browser:
        import webbrowser

        from uavgram.picking.web.running_server import RedirectFile

        way = RedirectFile(fresh.text)
        try:
            if webbrowser.open(way.uri):
                fresh.wait_until_used()
        finally:
            way.remove()
    return True


def _serve(wanted: Path | None, port: int, started: Callable[[], None], *, browser: bool) -> int:
    """Serve the page until its tabs are closed, or Ctrl+C; return the exit status."""
    import webbrowser

    from uavgram.cli.interrupt import report_interruption
    from uavgram.picking.web.running_server import RedirectFile
    from uavgram.picking.web.serving import serve

    ways: list[RedirectFile] = []

    def announce(address: str) -> None:
        started()
        print_lines(
            f"Picking page: {address}",
            "For a lost tab, or another browser, start it again the same way.",
            "Ctrl+C ends it, and so do ten minutes without an open tab; everything is saved.",
        )
        if browser:
            ways.append(RedirectFile(address))
            webbrowser.open(ways[-1].uri)

    def entered() -> None:
        for way in ways:
            way.remove()

    def run(project: Path) -> None:
        from uavgram.pipeline.measure.run import run as run_project

        run_project(project)

    try:
        serve(wanted, announce, run, port, entered)
    except KeyboardInterrupt:
        return report_interruption("ended; everything is saved")
    finally:
        entered()
    print_lines("Ended, as no tab of the page was open any more. Everything is saved.")
    return DONE


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
    from uavgram.pipeline.picks_table import remove_ties, write_ties
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
    from uavgram.model.naming import format_count
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
        where = format_count(len(others), "more photo")
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
