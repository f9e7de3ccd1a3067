"""Command `uavgram log`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Json, app
from uavgram.cli.terminal import print_json, print_lines


@app.command(name="log")
def show_log(
    file: Path,
    /,
    *,
    json: Json = False,
    plot: Path | None = None,
) -> int:
    """Summarise a flight log: span, vehicle, boots, messages, clock, camera events.

    Parameters
    ----------
    file
        ArduPilot DataFlash .bin/.BIN/.log, MAVLink .tlog, or PX4 .ulg.
    json
        Print a JSON object instead of text.
    plot
        Also draw track, heights, clock and camera events to this PNG.
    """
    from uavgram.io.logs.flight_log import read_flight_log
    from uavgram.io.outputs import replace_bytes
    from uavgram.stages.log_summary import summarise_log
    from uavgram.views.flight_log import collect_log_content, log_summary_lines

    summary = summarise_log(read_flight_log(file, positions_needed=False))
    if plot is not None:
        from uavgram.views.flight_log_plot import log_plot_png

        replace_bytes(plot, log_plot_png(summary))
    print_json(collect_log_content(summary)) if json else print_lines(*log_summary_lines(summary))
    return DONE
