"""`uavgram pick`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, say, tell_as

Port = Annotated[int, Parameter(validator=validators.Number(gte=0, lte=65535))]


@app.command
def pick(
    project: Path = Path(),
    /,
    *,
    port: Port = 0,
    browser: bool = True,
    verbose: Verbose = False,
) -> int:
    """Pick points and lengths in the photos on a local page, and see the measurements.

    The project may lack picks, lengths and measurements: they are made here. Ctrl+C ends it.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    port
        Of the page, on this machine only; 0: any free one.
    browser
        Open the page in the browser.
    verbose
        Say what is being done.
    """
    import os
    import webbrowser

    # Small systems many times a second: threads inside one of them only wait for each other, and
    # the browser needs the processors too. Read when numpy is loaded, which is below.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    from uavgram.picking.web.redirect import RedirectFile
    from uavgram.picking.web.server import serve

    log_to_stderr(verbose=verbose)
    tell_as(project)
    ways: list[RedirectFile] = []

    def announce(address: str) -> None:
        say(f"Picking page: {address}", "Ctrl+C ends it; everything is saved.")
        if browser:
            ways.append(RedirectFile(address))
            webbrowser.open(ways[-1].uri)

    def entered() -> None:
        for way in ways:
            way.remove()

    def run() -> None:
        from uavgram.pipeline.measure.run import run as run_project

        run_project(project)

    try:
        serve(project, announce, run, port, entered)
    finally:
        entered()
    say("Saved.")
    return DONE
