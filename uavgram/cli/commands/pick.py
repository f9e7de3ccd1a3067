"""Command `uavgram pick`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Flag, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, progress, set_project_units

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

    from uavgram.picking.web.running_server import one_start_at_a_time

    log_to_stderr(verbose=verbose)
    wanted = _sample(project) if sample else project or _find_present_folder()
    if wanted is not None and not _lacks_project(wanted):
        set_project_units(wanted)
    with contextlib.ExitStack() as starting:
        starting.enter_context(one_start_at_a_time())
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

    if wanted is not None and not _lacks_project(wanted):
        load_project(wanted, unfinished=True)  # its faults are reported here
    fresh = request_address(wanted, lambda door: port in {0, door.port})
    if fresh is None:
        return False
    opened = "a new tab opens" if browser else "open"
    print_lines(
        f"The page runs already; {opened}: {fresh.text}", "It works once, within five minutes."
    )
    if browser:
        import webbrowser

        from uavgram.picking.web.redirect import RedirectFile

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
    from uavgram.picking.web.redirect import RedirectFile
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
