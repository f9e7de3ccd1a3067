"""Command `uavgram pick`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Flag, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, tell_as

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
    `uavgram` alone do the same. Ctrl+C ends it.

    While it runs, the same command again gives a fresh address, for another browser or a lost tab.

    Parameters
    ----------
    project
        The project file, or a folder with or without a project; by default the present folder, if
        it holds a project or photos.
    sample
        Make a small survey for practice (photos, flight log and camera, nothing picked) in the
        named folder, by default uavgram-sample, and open it; an existing one is continued.
    port
        Port of the page, on this machine only; 0: any free one.
    browser
        Open the page in the browser.
    verbose
        Show the progress of the work.
    """
    import os

    # Small systems many times a second: threads inside one of them only wait for each other, and
    # the browser needs the processors too. Read when numpy is loaded, which is below.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    log_to_stderr(verbose=verbose)
    wanted = _sample(project) if sample else project or _present()
    if wanted is None or _has_none(wanted):
        _serve(wanted, port, browser=browser)
        return DONE
    tell_as(wanted)
    if not _led_to_running(wanted, browser=browser):
        _serve(wanted, port, browser=browser)
    return DONE


def _has_none(folder: Path) -> bool:
    """Return whether it is a folder without a project, to be set up on the page."""
    from uavgram.config.project import PROJECT_FILE

    return folder.is_dir() and not (folder / PROJECT_FILE).exists()


def _present() -> Path | None:
    """Return the present folder, if it holds a project or photos."""
    from uavgram.io.browse import count_photos, find_home_and_drives

    return Path() if count_photos(Path.cwd()).is_flight(find_home_and_drives()) else None


def _sample(folder: Path | None) -> Path:
    """Return the project of the sample, which is made if it does not exist yet."""
    from uavgram.synthetic.accident_scene import TAPE_FILE
    from uavgram.synthetic.demo import SAMPLE_NAME, make_sample

    made = make_sample(folder or Path(SAMPLE_NAME), progress())
    say(f"Sample to play with: {made.parent}; its taped lengths: {made.with_name(TAPE_FILE)}")
    return made


def _led_to_running(project: Path, *, browser: bool) -> bool:
    """Give a fresh address of the page that has the project open; return whether there is one."""
    from uavgram.picking.web.running import fresh_address

    fresh = fresh_address(project)
    if fresh is None:
        return False
    say(
        f"The page runs already. Fresh address: {fresh.text}", "It works once, within five minutes."
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


def _serve(wanted: Path | None, port: int, *, browser: bool) -> None:
    """Serve the page until Ctrl+C."""
    import webbrowser

    from uavgram.picking.web.redirect import RedirectFile
    from uavgram.picking.web.serving import serve

    ways: list[RedirectFile] = []

    def announce(address: str) -> None:
        say(
            f"Picking page: {address}",
            "For another browser, or a lost tab, run the same command again meanwhile.",
            "Ctrl+C ends it; everything is saved.",
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
    finally:
        entered()
    say("Saved.")
