"""`uavgram picks import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators

from uavgram.cli.application import DONE, Decimal, app
from uavgram.cli.terminal import say
from uavgram.errors import InputError

picks = App(name="picks", help="Take over picks that were made in another program.")
app.command(picks)


@picks.command(name="import")
def import_(
    files: list[Path],
    /,
    *,
    output: Path,
    control: Path | None = None,
    control_sigma_m: Annotated[Decimal | None, Parameter(validator=validators.Number(gt=0))] = None,
) -> int:
    """Write a picks.csv from LabelMe's JSON files or OpenDroneMap's gcp_list.txt.

    Parameters
    ----------
    files
        LabelMe .json files (points and circles), or one gcp_list.txt.
    output
        The picks.csv to write; one that is there is never written over.
    control
        Also write the coordinates of a gcp_list.txt to this control.csv.
    control_sigma_m
        Standard deviation of those coordinates, which the file does not hold.
    """
    from uavgram.pipeline.import_picks import import_picks
    from uavgram.views.table import message_lines

    if (control is None) != (control_sigma_m is None):
        raise InputError(files[0], "--control and --control-sigma-m belong together")
    done = import_picks(files, output, control, control_sigma_m)
    say(*message_lines(done.messages))
    say(f"{done.picks} picks of {done.labels} labels in {done.images} photos: {output}")
    if control is not None:
        say(f"{done.control} control points: {control}")
    return DONE
