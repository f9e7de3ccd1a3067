"""Plan of a scene, with messages to read before flying."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.naming import figures
from uavgram.model.planned import (
    Assumptions,
    FlightFacts,
    FlightPlanned,
    PlannedFrames,
    PlannedLines,
    PlannedMeasurements,
    PlannedPlates,
    PlannedPoints,
    PlannedSite,
)
from uavgram.pipeline.progress import Progress, silent
from uavgram.synthetic.plan.accuracy import (
    compute_gain,
    compute_mean_sigma,
    get_criterion_name,
    list_ends,
    list_gains,
    list_planned_lines,
    list_planned_measurements,
    list_planned_plates,
    map_accuracy,
)
from uavgram.synthetic.plan.cameras import compute_footprints
from uavgram.synthetic.plan.choose import Choice, choose_flight
from uavgram.synthetic.plan.flights import find_covering_flights
from uavgram.synthetic.plan.scene import Asked, PlanScene
from uavgram.synthetic.plan.survey import predict_values
from uavgram.synthetic.plan.wanted import list_wanted
from uavgram.synthetic.scenario import Scenario, Site

GROSS_ERROR_M = 0.3
"""Gross error of a tape reading that people do make: a slipped decimetre mark or three."""

MIN_GAIN = 0.1
"""Smallest relative reduction of the sigmas for which reference lines are worth the work."""


MIN_ROBUST_LINES = 3
"""Number of lines below which the tilt of a single photo depends on its log.

Over the sigmas of the log, lengths are so nonlinear in the tilt that errors of simulated surveys
were 1.0 to 1.3 times the first-order prediction with one line, and 0.95 to 1.2 times with two;
second order overshoots there. Neither effect occurs with three lines or more.
"""


def make_no_site_message() -> Message:
    """Return the message for a plan in metres without a geodetic origin."""
    site = Site()
    return Message(
        "warning",
        "plan-nowhere",
        "The place on earth is unknown, so no mission file was written: the maps and the "
        "north of the drawing are of the place of the program's demo "
        f"({site.latitude_deg:.4f}, {site.longitude_deg:.4f}). Write site: {{latitude_deg: ..., "
        "longitude_deg: ..., scene_east_m: 0, scene_north_m: 0, road_azimuth_deg: ...}, where "
        "your [0, 0] is and where the first axis of your metres points, clockwise from north; "
        "or give the area as a GeoJSON or KML file.",
    )


def list_remarks(
    laid: tuple[PlannedLines, PlannedPlates],
    measured: PlannedMeasurements,
    gained: float,
    photos: int,
) -> Iterator[Message]:
    """Iterate over the messages to read before flying.

    Parameters
    ----------
    laid, measured
        Planned references and measurements; there are either lines or plates.
    gained
        Relative reduction of the mean sigma by the references; 1 if undetermined without.
    photos
        Number of photos.
    """
    lines, plates = laid
    if gained < MIN_GAIN and (lines.name or plates.name):
        what, instead = (
            (f"Plates of {plates.side_m:g} m", "larger ones, tape long lines (lay: lines)")
            if plates.name
            else (
                f"The reference lines, the longest {lines.length_m.max():.1f} m,",
                "a longer tape (longest_tape_m), a better log",
            )
        )
        yield Message(
            "warning",
            "plan-lines-useless",
            f"{what} make the measurements only {100 * gained:.0f} % more certain than none. Use "
            f"{instead}, or save the work.",
            lengths=lines.name,
        )
    if photos == 1 and 0 < len(lines.name) < MIN_ROBUST_LINES:
        yield Message(
            "warning",
            "plan-few-lines",
            f"With {len(lines.name)} reference line{'s' * (len(lines.name) > 1)} in a single photo "
            "errors may be up to a third larger than the ± of this plan: the tilt of the camera "
            f"is then known from the log alone. Lay {MIN_ROBUST_LINES} lines or more, or take more "
            "photos.",
            lengths=lines.name,
        )
    short = np.flatnonzero(measured.sigma > 1.0001 * measured.wanted_sigma)
    for i in short:
        yield Message(
            "warning",
            "plan-not-reached",
            f"{measured.name[i]!r} will be known to ± {figures(measured.sigma[i], 3)} "
            f"{measured.unit[i]}, "
            f"not to the ± {figures(measured.wanted_sigma[i], 3)} {measured.unit[i]} that are "
            "wanted, with "
            "any flight and layout that was tried. Allow more lines (most_lines), longer ones "
            "(longest_tape_m), lower heights or more photos (heights_m, frames, patterns), pick "
            "more sharply, or accept it.",
            measurements=(measured.name[i],),
        )
    passes = np.isnan(lines.mdb_m) | (lines.mdb_m > GROSS_ERROR_M)
    if passes.any():
        names = tuple(lines.name[i] for i in np.flatnonzero(passes))
        yield Message(
            "warning",
            "plan-unchecked",
            f"A mistake of {figures(GROSS_ERROR_M, 1)} m in the tape reading of {', '.join(names)} "
            "would go "
            "unnoticed: the other lines check it too little. Read the tape twice there, tape one "
            "more line, or take more photos.",
            lengths=names,
        )
    for own, kind, more in (
        (lines, "the line", "Tape one more line"),
        (plates, "the plate", "Lay one more plate"),
    ):
        names = tuple(own.name[i] for i in np.flatnonzero(np.isnan(own.mean_sigma_without)))
        if names:
            yield Message(
                "warning",
                "plan-needs-line",
                f"Without {kind} {', '.join(names)} too little fixes the photos for any useful "
                f"measurement. {more}, or write `robust: true` in the plan.",
                lengths=names if own is lines else (),
            )


def make_plan(scenario: Scenario, asked: Asked, progress: Progress = silent) -> FlightPlanned:
    """Choose flight and lines, and predict the accuracy.

    Parameters
    ----------
    scenario
        Its name, its camera and its log's class.
    asked
        Its request, in the world's axes.
    progress
        Shows long loops.

    Raises
    ------
    GeometryError
        No flight shows the area, or no line fits into it.
    """
    scene, request = asked.scene, asked.request
    wanted = list_wanted(scene)
    flown = find_covering_flights(scene, request, wanted)
    choice = choose_flight(scene, request, wanted, flown, progress)
    layout = choice.robust_layout if request.robust else choice.layout
    ends = list_ends(choice.possible, layout.lines)
    try:
        found = predict_values(scene, choice.flight.cameras, wanted, ends)
    except SingularError as fault:
        raise GeometryError(
            f"with {len(ends)} reference {choice.laid} the positions of the photos are not "
            "determined: allow more (lines), or fly with a log (telemetry)"
        ) from fault
    lines = list_planned_lines(scene, choice, layout.lines, found)
    plates = list_planned_plates(scene, choice, layout.lines)
    shown = scene.requests
    measured = list_planned_measurements(request, wanted, found)
    return FlightPlanned(
        name=scenario.name,
        site=PlannedSite(
            latitude_deg=asked.site.latitude_deg,
            longitude_deg=asked.site.longitude_deg,
            height_msl_m=asked.site.height_msl_m,
            undulation_m=asked.site.undulation_m,
            ground_height_m=scene.height_m,
        ),
        camera=scene.calibration,
        drone=scenario.camera.drone or "",
        area_world_m=scene.on_ground(scene.area_m),
        no_go_world_m=tuple(scene.on_ground(polygon) for polygon in scene.no_go_m),
        flight=_facts(asked, choice),
        assumptions=Assumptions(
            telemetry=scenario.telemetry,
            pick_sigma_px=scene.picks_sigma_px,
            tape_sigma_m=scene.tape_sigma_m,
            tape_scale_sigma=scene.tape.scale_sigma,
            roughness_m=request.roughness_m,
            deviation_m=request.deviation_m,
            deviation_deg=request.deviation_deg,
        ),
        frames=_frames(scene, choice),
        lines=lines,
        plates=plates,
        points=PlannedPoints(label=scene.label, world_m=scene.on_ground(scene.point_m)),
        measurements=measured if shown else _nothing(),
        grid=map_accuracy(scene, choice, layout.lines),
        mean_sigma=compute_mean_sigma(found),
        chosen_by=get_criterion_name(choice.possible),
        gains=tuple(list_gains(scene, request, wanted, choice, layout.lines)),
        messages=(
            *((make_no_site_message(),) if has_no_site(asked) else ()),
            *list_remarks(
                (lines, plates),
                measured,
                compute_gain(choice.possible, layout.lines),
                len(choice.flight.cameras.center_m),
            ),
        ),
    )


def has_no_site(asked: Asked) -> bool:
    """Return whether the area is in metres from an unspecified origin."""
    own, usual = asked.site, Site()
    named = (own.latitude_deg, own.longitude_deg) != (usual.latitude_deg, usual.longitude_deg)
    return not named and not isinstance(asked.request.area, str)


def _facts(asked: Asked, choice: Choice) -> FlightFacts:
    flown, request = choice.flight, asked.request
    slant = flown.height_m / max(np.sin(np.deg2rad(-flown.pitch_deg)), 0.1)
    return FlightFacts(
        pattern=flown.pattern,
        height_m=flown.height_m,
        gimbal_pitch_deg=flown.pitch_deg,
        speed_m_s=request.speed_m_s,
        seconds_per_photo=request.seconds_per_photo,
        path_m=flown.path_m,
        duration_s=flown.duration_s,
        battery_s=60.0 * request.battery_min,
        max_height_m=request.max_height_m,
        ground_sample_m=float(slant / asked.scene.calibration.parameters[0]),
    )


def _frames(scene: PlanScene, choice: Choice) -> PlannedFrames:
    cameras = choice.flight.cameras
    whole, certain = compute_footprints(scene, cameras)
    ground = scene.on_ground(cameras.center_m[:, :2])[:, 2]
    return PlannedFrames(
        name=tuple(f"P{i + 1}" for i in range(len(ground))),
        center_world_m=cameras.center_m,
        world_from_camera=cameras.world_from_camera,
        heading_deg=cameras.heading_deg,
        gimbal_pitch_deg=cameras.pitch_deg,
        height_above_ground_m=cameras.center_m[:, 2] - ground,
        footprint_world_m=whole,
        safe_footprint_world_m=certain,
    )


def _nothing() -> PlannedMeasurements:
    empty: Floats = np.zeros(0)
    return PlannedMeasurements(
        name=(), kind=(), unit=(), points=(), value=empty, sigma=empty, wanted_sigma=empty
    )
