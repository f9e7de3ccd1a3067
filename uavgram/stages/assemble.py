"""Assemble all observations into one survey, with indices instead of names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from uavgram.errors import GeometryError, suggest_spelling
from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.estimation.survey.observations.telemetry import compute_trend_inflation
from uavgram.estimation.survey.observed import Observations, add_readout
from uavgram.geometry.motion.camera_motion import LEVER_ARM, SHARED_SIZE
from uavgram.model.arrays import Floats, FrozenArrays, Ints
from uavgram.model.flight_log import Track
from uavgram.model.frames import Frames, Poses, Telemetry, TelemetryPrior
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_digits
from uavgram.model.observations import (
    KnownLines,
    KnownThing,
    KnownThings,
    KnownWorldPoints,
    Picks,
    do_lines_fix_plan,
)
from uavgram.model.options import GroundOptions
from uavgram.model.survey import DEFAULT_AREA, Ground, Survey
from uavgram.stages.tie_chains import find_matches, find_ties

FINE_M = 0.01
"""Step of an ordinary reading of a tape [m]."""

COARSE_M = (0.1, 0.05)
"""Steps to which people round [m]."""

PRIOR_ODDS = 0.1
"""Odds that a person rounds to one of these steps, and states a smaller uncertainty."""

SURE_ODDS = 20.0
"""Odds above which lengths count as rounded."""

ROUNDING_M = 1e-6
"""Largest difference of a number from a multiple of a step [m]."""


def find_reading_step(length_m: Floats) -> float:
    """Find the step to which lengths were rounded.

    Parameters
    ----------
    length_m
        (L,) readings.

    Returns
    -------
    step
        In metres; 0 without evidence for rounding.

    Notes
    -----
    Of readings to `FINE_M`, all of L different ones are multiples of a step by a chance of
    (`FINE_M` / step)^L. By Bayes' rule that chance and `PRIOR_ODDS` make the odds.
    """
    different = np.unique(length_m)
    for step in COARSE_M:
        off_m = np.abs(different - step * np.round(different / step))
        by_chance = (FINE_M / step) ** len(different)
        if (off_m < ROUNDING_M).all() and SURE_ODDS * by_chance < PRIOR_ODDS:
            return step
    return 0.0


def apply_reading_step(lines: KnownLines) -> tuple[KnownLines, tuple[Message, ...]]:
    """Enlarge the sigmas of lengths that were rounded more coarsely than their sigmas state.

    Parameters
    ----------
    lines
        All taped lengths, withheld ones too.

    Returns
    -------
    lines, messages
        Lengths with the standard deviation of a rounding, step / sqrt(12), where it exceeds the
        stated one; and a remark if it does.
    """
    rounding_m = find_reading_step(lines.length_m) / np.sqrt(12.0)
    is_finer = lines.sigma_m < rounding_m
    if not is_finer.any():
        return lines, ()
    sigma_m = np.where(is_finer, np.hypot(lines.sigma_m, rounding_m), lines.sigma_m)
    text = (
        f"The taped lengths are multiples of {format_digits(100 * np.sqrt(12.0) * rounding_m)} cm: "
        f"they "
        "were rounded to that, which makes each uncertain by "
        f"{format_digits(100 * rounding_m)} cm, and not {format_digits(100 * lines.sigma_m.min())} "
        f"cm as "
        "stated. The program counts with both. Read the tape to the centimetre for smaller "
        "uncertainties."
    )
    return replace(lines, sigma_m=sigma_m), (Message("info", "lengths-rounded", text),)


SIGNIFICANCE = 1e-4
"""Probability below which the heights of an area's control points are not in a plane."""


def free_control_heights(survey: Survey) -> Survey:
    """Free the heights of an area's control points where they are not in one plane.

    Where they are, they determine the plane. A stated height above the ground is kept.
    """
    free = np.array(survey.is_free)
    for area, ground in enumerate(survey.grounds):
        own = (survey.area == area) & ~survey.off_ground
        rows = np.flatnonzero(own[survey.control_label])
        sigma = np.hypot(survey.control_sigma_m[rows, 2], ground.roughness_sigma_m)
        squares = _misfit(survey.control_world_m[rows], sigma, ground.slope_sigma_rad)
        if compute_upper_tail(squares, len(rows) - 1.0) < SIGNIFICANCE:
            free[survey.control_label[rows]] = True
    return replace(survey, is_free=free)


def _misfit(place_m: Floats, sigma_m: Floats, slope_sigma: float) -> float:
    """Compute the weighted squares of heights about a plane of free height, level up to its sigma.

    Parameters
    ----------
    place_m, sigma_m
        (n, 3), (n,) points, and sigmas of their heights about the plane.
    slope_sigma
        Prior of the plane's slopes about level; n - 1 degrees of freedom are left.
    """
    if len(place_m) < 2:
        return 0.0
    place = place_m - place_m.mean(axis=0)
    design = np.column_stack([np.ones(len(place)), place[:, :2]]) / sigma_m[:, None]
    design = np.concatenate([design, np.eye(3)[1:] / slope_sigma])
    height = np.append(place[:, 2] / sigma_m, [0.0, 0.0])
    return float(np.sum((height - design @ np.linalg.lstsq(design, height)[0]) ** 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled(FrozenArrays):
    """Survey, with indices from the project's picks and lines into it.

    Attributes
    ----------
    survey
        Survey, ready to refine.
    pick_index
        (P,) into the survey's picks; -1 for matches, and for picks in frames without a pose.
    line_index
        (L,) into the survey's lines; -1 for withheld lines and those with an end never picked.
    pick_sigma_px
        (P,) of every pick, the default filled in.
    messages
        Messages on the gauge, and on control points and areas without a pick.
    """

    survey: Survey
    pick_index: Annotated[Ints, "p"]
    line_index: Annotated[Ints, "l"]
    pick_sigma_px: Annotated[Floats, "p"]
    messages: tuple[Message, ...] = ()


def assemble(observed: Observations) -> Assembled:
    """Assemble one survey from all observations.

    Frames take part where they have a pick or a tie and, with a log, an instant in it. The gauge is
    ``world`` where telemetry, two picked control points or lines of known position fix position and
    heading.

    Raises
    ------
    GeometryError
        No frame takes part.
    """
    picks, lines, control = observed.picks, observed.lines, observed.control
    telemetry = observed.telemetry
    chosen = _usable_picks(observed)
    copies = observed.copies
    picked = {copies.get(picks.image[i], picks.image[i]) for i in chosen} | _photos_with_ties(
        observed
    )
    order = (
        (*observed.photos, *picks.image, *observed.ties.image)
        if telemetry is None
        else telemetry.poses.frame_id
    )
    frame_at = _rows(name for name in order if name in picked)
    shown_at = frame_at | {
        copy: frame_at[kept] for copy, kept in copies.items() if kept in frame_at
    }
    label_at = _rows(picks.label[i] for i in chosen)
    seen = [
        i
        for i in range(len(lines.name))
        if lines.adjust[i] and lines.start[i] in label_at and lines.end[i] in label_at
    ]
    known = [i for i, name in enumerate(control.label) if name in label_at]
    things = _select_usable_known(observed.known, label_at)
    is_placed = telemetry is not None or len(known) >= 2 or do_lines_fix_plan(things)
    gauge: Literal["world", "plane"] = "world" if is_placed else "plane"
    if gauge == "plane":
        known = []
    areas = _areas(picks, label_at)
    # The default area comes first where it has any label: with a free gauge it is z = 0.
    area_at = _rows(sorted(areas, key=lambda name: name != DEFAULT_AREA))
    sigma = np.where(np.isnan(picks.sigma_px), observed.picks_sigma_px, picks.sigma_px)
    matches, stale = find_matches(picks, sigma, _index(chosen, len(picks.image)), shown_at)
    time_s, time_sigma_s = _times(observed.exposures, frame_at)
    survey = Survey(
        frame_id=tuple(frame_at),
        time_s=time_s,
        time_sigma_s=time_sigma_s,
        seeds=None if telemetry is None else _order_poses(telemetry.poses, frame_at),
        telemetry=None if telemetry is None else _prior(telemetry, frame_at),
        track=None if telemetry is None else telemetry.track,
        calibration=observed.calibration,
        label=tuple(label_at),
        height_above_m=_collect_by_label(picks, picks.height_m, label_at),
        height_sigma_m=_collect_by_label(picks, picks.height_sigma_m, label_at),
        is_free=np.isin(list(label_at), np.array(picks.label)[picks.is_free]),
        identification_sigma_m=np.full(len(label_at), observed.picks_identification_sigma_m),
        pick_frame=np.array([shown_at[picks.image[i]] for i in chosen]),
        pick_label=np.array([label_at[picks.label[i]] for i in chosen]),
        pixel_px=picks.pixel_px[chosen],
        pick_sigma_px=sigma[chosen],
        target_pick=np.flatnonzero(picks.of_source("target")[chosen]),
        matches=matches,
        ties=find_ties(observed.ties, frame_at),
        line_start=np.array([label_at[lines.start[i]] for i in seen], dtype=np.int64),
        line_end=np.array([label_at[lines.end[i]] for i in seen], dtype=np.int64),
        length_m=lines.length_m[seen],
        length_sigma_m=lines.sigma_m[seen],
        line_name=tuple(lines.name[i] for i in seen),
        line_tape=tuple(lines.tape[i] for i in seen),
        line_along=tuple(lines.along_of(i) for i in seen) if lines.along else (),
        tape_scale_sigma=observed.tape.scale_sigma,
        own_scale_sigma=observed.own_scale_sigma,
        known=things,
        control_label=np.array([label_at[control.label[i]] for i in known], dtype=np.int64),
        control_world_m=control.world_m[known],
        control_sigma_m=control.sigma_m[known],
        grounds=tuple(_ground(observed.ground, name) for name in area_at),
        area=np.array([area_at[name] for name in areas]),
        gauge=gauge,
    )
    survey = free_control_heights(survey)
    if survey.telemetry is not None:
        nominal = np.zeros(SHARED_SIZE)
        nominal[LEVER_ARM] = survey.telemetry.lever_arm_m
        survey = add_readout(survey, nominal)
    return Assembled(
        survey=survey,
        pick_index=_index(chosen, len(picks.image)),
        line_index=_index(seen, len(lines.name)),
        pick_sigma_px=sigma,
        messages=(
            *_gauge(survey),
            *stale,
            *_level_lines(survey),
            *_report_unseen_control(control, survey),
            *_report_unpicked_areas(observed.ground, survey),
            *_report_unused_readout(survey),
        ),
    )


def _usable_picks(observed: Observations) -> Ints:
    """Return indices of the picks, without matches, in photos that take part."""
    picks, posed = observed.picks, _usable_photos(observed)
    usable = posed - set(observed.contradicting)
    used = np.flatnonzero([image in usable for image in picks.image])
    used = used[~(picks.of_source("match") | picks.is_copy)[used]]
    if observed.copies:  # a second click counts, a pick that was copied with the photo does not
        shown = [observed.copies.get(name, name) for name in picks.image]
        places = zip(shown, picks.label, *picks.pixel_px.T.tolist(), strict=True)
        first = {place: i for i, place in reversed(list(enumerate(places)))}
        used = used[np.isin(used, list(first.values()))]
    for one, other in observed.contradicting.items():
        if not used.size:
            raise GeometryError(
                f"no usable pick remains: {one} and {other} are the same file, but most labels are "
                "picked at other places in one than in the other. Look at both, and delete the "
                "wrong picks, or pick them in their own photo"
            )
    if not used.size:
        raise GeometryError(
            "no usable frame remains: the flight log covers no photo with a pick. "
            "`uavgram check` lists the reason for each photo"
        )
    return used


def _usable_photos(observed: Observations) -> set[str]:
    """Return photos that may take part, and others of the same exposures."""
    telemetry, copies = observed.telemetry, observed.copies
    seen = {*observed.picks.image, *observed.ties.image}
    posed = seen if telemetry is None else set(telemetry.poses.frame_id)
    counted = {copies.get(name, name) for name in posed}
    return counted | {copy for copy, kept in copies.items() if kept in counted}


def _photos_with_ties(observed: Observations) -> set[str]:
    """Return photos that take part because of matches or ties."""
    found = {observed.picks.image[i] for i in np.flatnonzero(observed.picks.of_source("match"))}
    return (found | set(observed.ties.image)) & _usable_photos(observed) - set(observed.copies)


def _rows(names: Iterable[str]) -> dict[str, int]:
    """Map each name, once and in order, to its position."""
    return {name: k for k, name in enumerate(dict.fromkeys(names))}


def _times(exposures: Frames | None, frame_at: Iterable[str]) -> tuple[Floats, Floats]:
    """Return instants (F,) of the frames and their own sigmas (F,); NaN where unknown."""
    taken: dict[str, tuple[float, float]] = {}
    if exposures is not None:
        both = zip(exposures.time_utc_s.tolist(), exposures.sigma_time_s.tolist(), strict=True)
        taken = dict(zip(exposures.frame_id, both, strict=True))
    found = np.array([taken.get(name, (np.nan, np.nan)) for name in frame_at]).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _index(chosen: Ints | list[int], count: int) -> Ints:
    """Return positions (count,) among the chosen ones; -1 for the others."""
    index = np.full(count, -1)
    index[chosen] = np.arange(len(chosen))
    return index


def _select_usable_known(known: KnownThings, label_at: dict[str, int]) -> tuple[KnownThing, ...]:
    """Return known things of picked points, without withheld ones."""
    things = (known.get_seen_thing(i, label_at) for i in np.flatnonzero(known.adjust).tolist())
    return tuple(thing for thing in things if thing is not None)


def _collect_by_label(picks: Picks, value: Floats, label_at: dict[str, int]) -> Floats:
    """Return the value (K,) of each label, stated at any of its picks (P,); otherwise 0."""
    found = np.zeros(len(label_at))
    for i in np.flatnonzero(np.isfinite(value)).tolist():
        if picks.label[i] in label_at:
            found[label_at[picks.label[i]]] = value[i]
    return found


def _areas(picks: Picks, label_at: dict[str, int]) -> list[str]:
    """Return the area (K,) of each label; stated at one pick, it holds for all."""
    areas = [DEFAULT_AREA] * len(label_at)
    for label, area in zip(picks.label, picks.area, strict=True):
        if area and label in label_at:
            areas[label_at[label]] = area
    return areas


def _ground(options: GroundOptions, area: str) -> Ground:
    """Return the prior of an area's plane."""
    own = options.of(area)
    return Ground(
        name=area,
        height_m=own.height_m,
        height_sigma_m=own.height_sigma_m,
        slope_sigma_rad=float(np.deg2rad(own.slope_sigma_deg)),
        roughness_sigma_m=own.roughness_sigma_m,
    )


def _gauge(survey: Survey) -> Iterator[Message]:
    if survey.gauge == "plane":
        yield Message(
            "info",
            "gauge-plane",
            "Nothing fixes position and heading (no flight log, fewer than two control points, no "
            "lines of known position): coordinates are relative to the first photo that is used. "
            "Its camera is above 0, 0, and up in it is north. Lengths, areas and angles do not "
            "depend on that.",
        )


def _level_lines(survey: Survey) -> Iterator[Message]:
    names = tuple(
        survey.line_name[i] for i, what in enumerate(survey.line_along) if what != "slope"
    )
    if names and survey.gauge == "plane":
        yield Message(
            "warning",
            "level-on-slope",
            "The slope of the ground is unknown (no flight log, fewer than two control points), so "
            "the lengths measured level are taken as lengths along the ground: on a slope of 5 "
            "degrees they are 0.4 % too short for that. Give lengths taped along the ground.",
            lengths=names,
        )


def _report_unseen_control(control: KnownWorldPoints, survey: Survey) -> Iterator[Message]:
    for label in control.label:
        if label not in survey.label:
            hint = f" ({near})" if (near := suggest_spelling(label, survey.label)) else ""
            yield Message(
                "warning",
                "control-unseen",
                f"The control point {label!r} is not used: it has no usable pick{hint}. Pick it, "
                "or correct its name; if no photo shows it, remove it from the control points.",
                labels=(label,),
                several=MessagePlural(
                    "{count} control points are not used, having no usable pick",
                    f"{label!r}{hint}",
                    ending="Pick them, or correct their names; if no photo shows one, remove it "
                    "from the control points.",
                ),
            )


def _report_unpicked_areas(ground: GroundOptions, survey: Survey) -> Iterator[Message]:
    """Report areas of the options without a usable pick."""
    picked = tuple(one.name for one in survey.grounds)
    for name in ground.areas:
        if name not in picked:
            hint = f" ({near})" if (near := suggest_spelling(name, picked)) else ""
            yield Message(
                "warning",
                "area-unpicked",
                f"The ground's area {name!r} is not used: no usable pick names it in the column "
                f"`area` of picks.csv{hint}. Name it there, or take it out of the project.",
                several=MessagePlural(
                    "{count} areas of the ground are not used: no usable pick names them in the "
                    "column `area` of picks.csv",
                    f"{name!r}{hint}",
                    ending="Name them there, or take them out of the project.",
                ),
            )


def _report_unused_readout(survey: Survey) -> Iterator[Message]:
    """Report a known readout time without knowledge of the motion."""
    readout, logged = survey.calibration.readout, isinstance(survey.track, Track)
    if readout is not None and readout.value_s and not (logged or survey.ties.points):
        yield Message(
            "info",
            "readout-unused",
            f"This camera reads a photo in {1e3 * abs(readout.value_s):.0f} ms, row after row. Its "
            "motion meanwhile is unknown without a flight log, so the effect is not corrected and "
            "stays in the results. Name the flight's log (`log:`), if there is "
            "one; or find tie points (`uavgram picks ties`), which show much of it.",
        )


def _order_poses(poses: Poses, names: Iterable[str]) -> Poses:
    row = _rows(poses.frame_id)
    return poses.take(np.array([row[name] for name in names], dtype=np.int64))


def _prior(telemetry: Telemetry, frame_at: dict[str, int]) -> TelemetryPrior:
    prior = telemetry.prior
    names = [telemetry.poses.frame_id[k] for k in prior.frame_index]
    rows = [k for k, name in enumerate(names) if name in frame_at]
    time_s = prior.time_s[rows]
    factor = 1.0
    if telemetry.correlation_s is not None:
        factor = compute_trend_inflation(time_s, *telemetry.correlation_s)
    return replace(
        prior,
        frame_index=np.array([frame_at[names[k]] for k in rows]),
        time_s=time_s,
        covariance=factor * prior.covariance[rows],
    )
