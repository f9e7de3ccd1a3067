"""A planned flight as a recording: pages, legend, and the plan in space."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from PIL import Image

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.model.maps import close_ring
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells, wanted_strips
from uavgram.views import flight_plan, style
from uavgram.views.recording.blueprint import layout, legend_view, page_views, space_view
from uavgram.views.recording.labels import log_in_space, place_in_space
from uavgram.views.recording.legend import BAR_PX, LEGEND, LegendPicture
from uavgram.views.recording.scene import FRUSTUM_SHARE, SPACING_SHARE, TO_THE_EYE, Eye
from uavgram.views.recording.stream import Recorder, open_recording
from uavgram.views.survey.outlines import corner_rays, longest_middle, pyramids
from uavgram.views.tables import make_table, markdown, plain
from uavgram.views.units import convert_sentence, select_like_lengths

SUMMARY, LAY, PHOTO = "documents/summary", "documents/lines", "documents/photo"


def log_plan_documents(recorder: Recorder, planned: FlightPlanned, units: Units) -> None:
    """Log all pages.

    Parameters
    ----------
    recorder
        The open recording.
    planned
        The plan.
    units
        Units of the lengths shown.
    """
    named = (*planned.lines.name, *planned.measurements.name, *planned.points.label, planned.name)
    kept = select_like_lengths(named)
    for path, text in ((SUMMARY, summary_page(planned, units)), (LAY, lines_page(planned))):
        recorder.page(path, convert_sentence(text, units, kept))
    sheets = [
        convert_sentence(photo_page(planned, k), units) for k in range(len(planned.frames.name))
    ]
    recorder.sheets(PHOTO, sheets)


def summary_page(planned: FlightPlanned, units: Units) -> str:
    """Write the summary page."""
    parts = [
        f"# {plain(flight_plan.summarise_work(planned))}",
        *map(plain, flight_plan.describe_accuracy(planned)),
    ]
    parts += [f"**{plain(m.text)}** `{m.code}`" for m in planned.messages if m.level != "info"]
    if planned.measurements.name:
        parts += ["## What will be measured", markdown(flight_plan.value_table(planned, units))]
    flight = markdown(make_table(" | *", flight_plan.flight_facts(planned)))
    parts += ["## The flight", flight, plain(flight_plan.take_off_words(planned))]
    if planned.gains:
        more = [(gain.what, f"± {100 * gain.mean_sigma:.1f} cm") for gain in planned.gains]
        parts += ["## Other choices", markdown(make_table("with | on average", more))]
    parts += [
        plain(text)
        for text in (flight_plan.describe_criterion(planned), flight_plan.list_assumptions(planned))
        if text
    ]
    parts += [f"{plain(m.text)} `{m.code}`" for m in planned.messages if m.level == "info"]
    return "\n\n".join(parts)


def lines_page(planned: FlightPlanned) -> str:
    """Write the page of lines and plates to lay out, and of alternatives."""
    laid = flight_plan.lay_table(planned)
    if not laid.rows:
        return "No line is to be laid."
    return "\n\n".join([markdown(laid), *map(plain, flight_plan.describe_alternatives(planned))])


def photo_page(planned: FlightPlanned, row: int) -> str:
    """Write the sheet of one photo: position and attitude of the drone."""
    frames = planned.frames
    facts = [
        ("height above the ground", flight_plan.metres(float(frames.height_above_ground_m[row]))),
        ("nose", f"{frames.heading_deg[row] % 360:.0f}° from north"),
        ("camera", f"{-frames.gimbal_pitch_deg[row]:.0f}° below level"),
    ]
    return f"# {plain(frames.name[row])}\n\n" + markdown(make_table(" | ", facts))


ROWS_PX = (12, 62)
HEIGHT_PX = 108


def log_plan_legend(recorder: Recorder, planned: FlightPlanned, units: Units) -> None:
    """Log the picture.

    Parameters
    ----------
    recorder
        The open recording.
    planned
        The plan.
    units
        Units of the lengths shown.
    """
    recorder.picture(LEGEND, draw_plan_legend(planned, units))


def draw_plan_legend(planned: FlightPlanned, units: Units) -> Image.Image:
    """Draw swatches for the objects that occur, then the colours of the map."""
    legend = LegendPicture(HEIGHT_PX, ROWS_PX)
    for text, colour in _entries(planned):
        legend.swatch(0, text, colour)
    reach = accuracy_range(planned)
    if reach is None:
        legend.write(1, "nothing can be measured in the area")
        return legend.cut()
    length = convert_sentence(flight_plan.metres(planned.grid.length_m), units)
    low, high = (convert_sentence(flight_plan.centimetres(one), units) for one in reach)
    legend.write(1, f"ground: lengths of {length} will be known to ±", 8)
    legend.scale(1, low, high, map_colours(np.linspace(0, 1, BAR_PX)))
    return legend.cut()


def _entries(planned: FlightPlanned) -> list[tuple[str, style.Rgb]]:
    entries: list[tuple[str, style.Rgb]] = []
    if planned.lines.name:
        entries.append(("line to lay and tape", style.REFERENCE))
    if planned.plates.name:
        entries.append(("plate to lay", style.REFERENCE))
    entries += [("photo to take", style.REFINED), ("this photo and its footprint", style.OBSERVED)]
    if planned.measurements.name:
        entries.append(("will be measured", style.MEASURED))
    if planned.no_go_world_m:
        entries.append(("keep out", style.BAD))
    return entries


SPACE = "plan"
NAMES, FLAT_NAMES = f"{SPACE}/names", f"{SPACE}/names_from_above"

DIM = 0.6
_DROP = 1e-3
"""Offset of the map below the objects on it, as a share of the size of the scene."""
FROM_ABOVE = 1.15
"""Distance of the eye above the area, relative to the size of the area."""


@dataclass(frozen=True, eq=False)
class PlanScene:
    """Extent of the scene, from which drawings are scaled.

    Attributes
    ----------
    size_m
        Size of the area.
    frusta_m
        (F, 10, 3) frusta of all photos.
    eye, top_eye
        Eye of the first view, which shows area, lines and photos; of the view from above.
    """

    size_m: float
    frusta_m: Floats
    eye: Eye
    top_eye: Eye


def measure_plan(planned: FlightPlanned) -> PlanScene:
    """Measure the extent of a plan."""
    frames, lines, camera = planned.frames, planned.lines, planned.camera
    area = planned.area_world_m
    size = float(np.ptp(area, axis=0).max())
    steps = np.linalg.norm(np.diff(frames.center_world_m, axis=0), axis=1)
    # as deep as frusta of other recordings, but visible even for a single photo
    depth = 2.0 * FRUSTUM_SHARE * planned.flight.height_m
    if len(steps):
        depth = min(depth, SPACING_SHARE * float(np.median(steps)))
    rays = depth * corner_rays(camera.parameters, camera.width_px, camera.height_px)
    frusta = pyramids(frames.center_world_m, frames.world_from_camera, rays)
    shown = [area, lines.start_world_m, lines.end_world_m, frusta.reshape(-1, 3)]
    above = Eye(np.array([0.0, 0.0, 1.0]), area.mean(axis=0), FROM_ABOVE * size)
    return PlanScene(size, frusta, Eye.fit(np.concatenate(shown), TO_THE_EYE), above)


def log_plan(recorder: Recorder, planned: FlightPlanned, scene: PlanScene, units: Units) -> None:
    """Log all static objects, and the photo of the timeline.

    Parameters
    ----------
    recorder
        The open recording; its frames are the photos of the plan.
    planned
        The plan.
    scene
        Extent of the scene.
    units
        Units of the names.
    """
    recorder.static(SPACE, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _ground(recorder, planned, scene)
    _flight(recorder, planned, scene)
    lines = planned.lines
    strips = np.stack([lines.start_world_m, lines.end_world_m], axis=1)
    recorder.lines(f"{SPACE}/lines_to_lay", strips, style.REFERENCE, 5.0)
    rings = [close_ring(ring) for ring in planned.plates.corner_world_m]
    recorder.lines(f"{SPACE}/plates_to_lay", rings, style.REFERENCE, 5.0)
    wanted = list(wanted_strips(planned).values())
    recorder.lines(f"{SPACE}/wanted", wanted, style.MEASURED, 3.0)
    if planned.points.label:
        recorder.dots(f"{SPACE}/points", planned.points.world_m, style.MEASURED, 3.5)
    _names(recorder, planned, scene, units)


def accuracy_range(planned: FlightPlanned) -> tuple[float, float] | None:
    """Return the best and worst standard deviation of the map; None if nothing can be measured."""
    known = planned.grid.sigma_m[np.isfinite(planned.grid.sigma_m)]
    return (float(known.min()), float(known.max())) if len(known) else None


def map_colours(share: Floats) -> Pixels:
    """Return (N, 3) dim colours of the map, from the best (0) to the worst (1), as a background."""
    return (DIM * style.scale_colours(share)).astype(np.uint8)


def _ground(recorder: Recorder, planned: FlightPlanned, scene: PlanScene) -> None:
    recorder.lines(f"{SPACE}/area", [close_ring(planned.area_world_m)], style.OBSERVED, 2.0)
    rings = [close_ring(ring) for ring in planned.no_go_world_m]
    recorder.lines(f"{SPACE}/keep_out", rings, style.BAD, 4.0)
    reach = accuracy_range(planned)
    if reach is None:
        return
    low, high = reach
    known = np.isfinite(planned.grid.sigma_m)
    share = (planned.grid.sigma_m[known] - low) / max(high - low, 1e-12)
    corners = grid_cells(planned)[known] - np.array([0.0, 0.0, _DROP * scene.size_m])
    recorder.squares(f"{SPACE}/accuracy", corners, map_colours(share))


def _flight(recorder: Recorder, planned: FlightPlanned, scene: PlanScene) -> None:
    frames = planned.frames
    if len(frames.name) > 1:
        recorder.lines(f"{SPACE}/flight", [frames.center_world_m], style.REFINED, 1.5)
    recorder.lines(f"{SPACE}/photos", scene.frusta_m, style.REFINED, 1.5)
    rings = [close_ring(ring) for ring in frames.footprint_world_m]
    recorder.lines(f"{SPACE}/footprints", rings, style.QUIET, 0.8)
    for name, strips, width in (
        ("this_photo", list(scene.frusta_m), 3.0),
        ("footprint_of_this_photo", rings, 2.0),
    ):
        recorder.lines_of_frames(
            f"{SPACE}/{name}", [[one] for one in strips], style.OBSERVED, width
        )


def _name_places(planned: FlightPlanned, units: Units) -> tuple[list[Floats], list[str]]:
    """Return (3,) places on the ground and their names, the most important first."""
    lines, rows = planned.lines, planned.measurements
    places = list((lines.start_world_m + lines.end_world_m) / 2)
    words = [
        f"{name} {convert_sentence(flight_plan.metres(float(length)), units)}"
        for name, length in zip(lines.name, lines.length_m, strict=True)
    ]
    places += list(planned.plates.center_world_m)
    words += list(planned.plates.name)
    for k, strip in wanted_strips(planned).items():
        places.append(longest_middle(strip))
        sigma = convert_sentence(flight_plan.centimetres(float(rows.sigma[k])), units)
        words.append(rows.name[k] + (f" ± {sigma}" if rows.unit[k] == "m" else ""))
    places += [ring.mean(axis=0) for ring in planned.no_go_world_m]
    words += ["keep out"] * len(planned.no_go_world_m)
    places += list(planned.area_world_m)
    words += [f"corner {k}" for k in range(1, len(planned.area_world_m) + 1)]
    return places, words


def _names(recorder: Recorder, planned: FlightPlanned, scene: PlanScene, units: Units) -> None:
    """Log separate names for both views, as their free space differs."""
    places, words = _name_places(planned, units)
    frames, points = planned.frames, planned.points.world_m
    above = np.array(places)
    log_in_space(recorder, FLAT_NAMES, place_in_space(scene.top_eye, above, words, dots_m=points))
    placed = place_in_space(
        scene.eye,
        np.concatenate([above, frames.center_world_m]),
        [*words, *frames.name],
        dots_m=np.concatenate([points, frames.center_world_m]),
    )
    log_in_space(recorder, NAMES, placed)


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
    identity = ("plan", planned.name, planned.frames.center_world_m.tobytes())
    times = np.full(count, np.nan)  # the time of the flight is unknown
    with open_recording(path, identity, f"{planned.name}: plan", times) as recorder:
        recorder.stream.send_blueprint(plan_blueprint(scene))
        log_plan(recorder, planned, scene, units)
        log_plan_legend(recorder, planned, units)
        log_plan_documents(recorder, planned, units)


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
    pages = page_views((SUMMARY, "Summary"), (LAY, "Lines and plates"), (PHOTO, "This photo"))
    left = rrb.Vertical(views, legend_view(), row_shares=[10, 1.0])
    return layout(rrb.Horizontal(left, pages, column_shares=[1.5, 1]))
