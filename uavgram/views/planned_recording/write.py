"""Writer of a plan as a recording: one call, one complete file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from uavgram.errors import OutputError
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.planned_recording.documents import LAY, PHOTO, SUMMARY, log_plan_documents
from uavgram.views.planned_recording.legend import log_plan_legend
from uavgram.views.planned_recording.space import (
    FLAT_NAMES,
    NAMES,
    SPACE,
    PlanScene,
    log_plan,
    measure_plan,
)
from uavgram.views.recording.blueprint import BACKGROUND, layout, space_view
from uavgram.views.recording.stream import open_recording
from uavgram.views.recording.world.legend import LEGEND


def write_plan_recording(planned: FlightPlanned, path: Path, units: Units = METRIC) -> None:
    """Write a Rerun recording with its blueprint inside; its frames are the photos to take.

    Parameters
    ----------
    planned
        The plan.
    path
        The .rrd file.
    units
        Units in which lengths are shown.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    scene = measure_plan(planned)
    count = len(planned.frames.name)
    try:
        path.touch()  # Rerun's own error for a missing folder is no OSError
        identity = ("plan", planned.name, planned.frames.center_world_m.tobytes())
        times = np.full(count, np.nan)  # the time of the flight is unknown
        with open_recording(path, identity, f"{planned.name}: plan", times) as recorder:
            log_plan(recorder, planned, scene, units)
            log_plan_legend(recorder, planned, units)
            log_plan_documents(recorder, planned, units)
            recorder.stream.send_blueprint(plan_blueprint(scene))
    except OSError as error:
        raise OutputError(f"{path}: the recording cannot be written: {error}") from error


def plan_blueprint(scene: PlanScene) -> rrb.Blueprint:
    """Lay out the plan in space on the left, pages on the right."""
    contents = [f"+ /{SPACE}/**", f"- /{SPACE}/footprints"]
    eye, above = scene.eye, scene.top_eye
    flat = [*contents, f"- /{NAMES}/**", f"- /{SPACE}/photos", f"- /{SPACE}/this_photo"]
    contents.append(f"- /{FLAT_NAMES}/**")
    views = rrb.Tabs(
        space_view(
            "Plan, north away from you", contents, eye.position_m, eye.target_m, up=(0, 0, 1)
        ),
        space_view("From above, north up", flat, above.position_m, above.target_m),
        active_tab=0,
    )
    legend = rrb.Spatial2DView(origin=LEGEND, name="Legend", titlebar=False, background=BACKGROUND)
    pages = rrb.Tabs(
        rrb.TextDocumentView(origin=SUMMARY, name="Summary"),
        rrb.TextDocumentView(origin=LAY, name="What to lay"),
        rrb.TextDocumentView(origin=PHOTO, name="This photo"),
        active_tab=0,
    )
    left = rrb.Vertical(views, legend, row_shares=[10, 1.0])
    return layout(rrb.Horizontal(left, pages, column_shares=[1.5, 1]))
